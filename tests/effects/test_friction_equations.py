"""Friction of the drive, each kind against its equation once more."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from forcegrasp.effects import get_effect
from forcegrasp.physics.gripper_file import load_gripper
from forcegrasp.physics.plant import Plant

from .rollouts import START_M, path, rollout, start
from .signals import DT, GAIN, make, settle


@pytest.mark.parametrize("friction", [0.01, 0.03, 0.1])
def test_coulomb_friction_stops_short_by_an_offset_that_flips(friction):
    command, far = 0.030, 0.006
    closing = settle("coulomb_friction", (friction,), command + far, command).position[0] - command
    opening = settle("coulomb_friction", (friction,), command - 0.003, command).position[0] - command
    assert closing == pytest.approx([friction / GAIN] * 2, rel=0.02)
    assert opening == pytest.approx([-friction / GAIN] * 2, rel=0.02)


def test_coulomb_friction_holds_up_to_its_size():
    plant = settle("coulomb_friction", (0.05,), START_M)
    plant.advance(np.full((1, 2), START_M + 0.95 * 0.05 / GAIN), 2000)
    assert plant.position[0] == pytest.approx([START_M] * 2, abs=4e-7)  # in 4 s
    plant.advance(np.full((1, 2), START_M + 1.5 * 0.05 / GAIN), 2000)
    assert plant.position[0] == pytest.approx([START_M + 0.5 * 0.05 / GAIN] * 2, abs=2e-5)


def test_coulomb_friction_holds_harder_in_finer_steps():
    """Where motors are stiff, what creeps counts: 10 µm are 0.2 N of one of 20 kN/m."""
    crept = []
    for factor in (1.0, 0.25):
        plant = Plant(load_gripper("tiago"), 1, "reference", threads=1, step_factor=factor)
        plant.attach([(get_effect("coulomb_friction")(np.array([[0.05]]), plant.dt), np.array([0]))])
        start(plant, [0], np.zeros(1))
        plant.advance(np.full((1, 2), START_M), round(1.0 / plant.dt))
        before = plant.position[0, 0]
        plant.advance(np.full((1, 2), START_M + 0.95 * 0.05 / GAIN), round(4.0 / plant.dt))
        crept.append(plant.position[0, 0] - before)
    assert crept[1] == pytest.approx(crept[0] / 4, rel=0.05)


def test_stiction_follows_the_stribeck_curve():
    for stribeck in (0.002, 0.01):
        effect = make("stiction", 0.05, 0.4, stribeck)
        for speed in (0.0, 0.001, 0.002, -0.002, 0.01, 1.0):
            stub = SimpleNamespace(velocity=np.full((1, 2), speed))
            friction = effect.attach(stub, np.array([0])).act().friction
            assert friction == pytest.approx(0.02 + 0.03 * np.exp(-((speed / stribeck) ** 2)), abs=1e-12)


def test_stiction_sticks_then_jumps():
    """On a slow ramp the finger waits until the spring of the servo pulls with F_s, then slips at once."""
    speed, breakaway = 0.0005, 0.15
    plant = settle("stiction", (breakaway, 0.2, 0.002), START_M)
    ramp, seen = START_M + speed * np.arange(1, 2001) * plant.dt, []
    for command in ramp:
        plant.advance(np.full((1, 2), command))
        seen.append((plant.position[0, 0], plant.velocity[0, 0]))
    position, velocity = np.array(seen).T
    first = np.argmax(position > START_M + 2e-5)
    assert ramp[first] - START_M == pytest.approx(breakaway / GAIN, rel=0.1)
    assert velocity[first:].max() > 5 * speed
    assert velocity[first + np.argmax(velocity[first:]) :].min() < 0.1 * speed  # and sticks again


@pytest.mark.parametrize("coefficient", [0.1, 0.3])
def test_load_friction_takes_its_share_of_a_squeeze(coefficient):
    """While closing |f| = c (F + P), so that of the motor's force F the pads get P = F (1 − c) / (1 + c)."""
    plant = settle("load_friction", (coefficient,), 0.0245, 0.0235, 0.0225)
    motor = GAIN * (plant.position[0] - 0.0225)
    np.testing.assert_allclose(plant.motor_force[0], -motor, rtol=1e-3)
    np.testing.assert_allclose(plant.outside_force[0], plant.pad_force[0])
    assert plant.pad_force[0] == pytest.approx(motor * (1 - coefficient) / (1 + coefficient), rel=0.04)


@pytest.mark.parametrize("coefficient", [0.1, 0.3])
def test_friction_of_a_transmission_that_turns_freely_until_pads_press(coefficient):
    """While closing P = F / (1 + c); where nothing presses, fingers go as without it."""
    plant = settle("load_friction", (coefficient,), 0.0245, 0.0235, 0.0225, variant="pressed")
    motor = GAIN * (plant.position[0] - 0.0225)
    assert plant.pad_force[0] == pytest.approx(motor / (1 + coefficient), rel=0.04)
    loaded, free = (
        rollout(1, uses, commands=path((0.034, 0.04, 0.3), (0.036, 0.02, 0.2))).position
        for uses in ([(get_effect("load_friction"), [coefficient], "pressed", [0])], [])
    )
    np.testing.assert_array_equal(loaded, free)


@pytest.mark.parametrize("coefficient", [0.1, 0.3])
def test_friction_of_a_gear_by_what_its_motor_puts_in(coefficient):
    """While closing |f| = c F, so that of the motor's force F the pads get P = F (1 − c)."""
    plant = settle("load_friction", (coefficient,), 0.0245, 0.0235, 0.0225, variant="driven")
    motor = GAIN * (plant.position[0] - 0.0225)
    assert plant.pad_force[0] == pytest.approx(motor * (1 - coefficient), rel=0.04)


@pytest.mark.parametrize("name", ["load_friction", "smooth_load_friction"])
def test_what_speeds_up_a_rotor_does_not_load_its_gear(name):
    """Of 0.3 N 0.05 kg · (0.06 − 0.02) m/s / 0.5 s are the rotor's."""
    stub = SimpleNamespace(velocity=np.array([[0.02]]), motor_force=np.array([[0.3]]), rotor_inertia=np.array([[0.05]]))
    effect = get_effect(name)(np.array([[0.1, 0.0][: len(get_effect(name).parameters)]]), 0.5, "driven")
    effect.attach(stub, np.array([0])).reset(np.array([0]))
    stub.velocity = np.array([[0.06]])
    np.testing.assert_allclose(effect.act().friction, [[0.1 * (0.3 - 0.05 * 0.04 / 0.5)]])
    np.testing.assert_allclose(effect.act().friction, [[0.1 * 0.3]])  # it goes on as fast


@pytest.mark.parametrize("side", [-1, 1])
def test_load_friction_of_a_pendulum_is_as_wide_as_its_load(side):
    """Crept to from either side: F (1 ∓ c) = W (1 ± c), with F = kp (u − q) and W = m g l sin q."""
    coefficient, target = 0.1, 0.6
    plant = Plant(load_gripper("xl330_pendulum"), 1, threads=1)
    gain = plant.model.actuator_gainprm[0, 0]
    plant.attach([(get_effect("load_friction")(np.array([[coefficient]]), plant.dt), np.array([0]))])
    plant.reset(np.arange(1), np.zeros(1), np.full((1, 1), 0.3))
    plant.advance(np.full((1, 1), target + 0.3 * side), 1500)
    for command in np.linspace(target + 0.3 * side, target, 6000):
        plant.advance(np.full((1, 1), command))
    plant.advance(np.full((1, 1), target), 500)
    angle = plant.position[0, 0]
    motor, weight = gain * (target - angle), 0.49 * 9.81 * 0.1 * np.sin(angle)
    np.testing.assert_allclose(plant.outside_force[0, 0], -weight, rtol=1e-3)
    ratio = (1 - coefficient) / (1 + coefficient)
    assert motor == pytest.approx(weight * ratio**side, rel=0.02)


def dahl(path: np.ndarray, slip: float) -> np.ndarray:
    """Bend of the bristles along a path, ``dz = (1 − z sign(dx) / z_c) dx`` in a thousand small steps each."""
    bend, seen = 0.0, []
    for moved in np.diff(path, prepend=path[0]) / 1000:
        for _ in range(1000):
            bend += (1 - bend * np.sign(moved) / slip) * moved
        seen.append(bend)
    return np.array(seen)


def test_presliding_bends_as_dahl_says():
    force, slip = 0.04, 3e-4
    path = np.concatenate([np.linspace(0, 8e-4, 40), np.linspace(8e-4, 7e-4, 20), np.linspace(7e-4, -5e-4, 30)])
    effect, pushes, held = make("presliding", force, slip), [], []
    for position, velocity in zip(path, np.gradient(path, DT), strict=True):
        stub = SimpleNamespace(position=np.full((1, 2), position), velocity=np.full((1, 2), velocity))
        added = effect.attach(stub, np.array([0])).act()
        pushes.append(added.motor_push[0, 0])
        held.append(added.damping[0, 0])
        assert not added.friction.any()
    bend = dahl(path, slip)
    assert np.array(pushes) == pytest.approx(-force * bend / slip, abs=1e-4 * force)
    rate = 1 - np.sign(np.gradient(path)) * bend / slip
    assert np.array(held) == pytest.approx(force / slip * (DT + 0.004) * rate, rel=2e-3)


@pytest.mark.parametrize("step", [2e-4, 1e-3])
def test_presliding_gives_way_to_a_small_push(step):
    """The servo's spring against the bristles: kp (δ − x) = F_c (1 − exp(−x / z_c))."""
    force, slip = 0.2, 5e-4
    plant = settle("presliding", (force, slip), START_M + step)
    expected = brentq(lambda x: GAIN * (step - x) + force * np.expm1(-x / slip), 0, step)
    assert plant.position[0] - START_M == pytest.approx([expected] * 2, rel=0.06)  # it comes with a little swing
    assert settle("coulomb_friction", (force,), START_M + step).position[0] == pytest.approx([START_M] * 2, abs=2e-5)


@pytest.mark.parametrize("slip", [1e-6, 1e-5, 1e-4])
def test_presliding_is_coulomb_friction_after_a_long_way(slip):
    friction, command = 0.03, 0.030
    for before, side in ((command + 0.006, 1), (command - 0.003, -1)):
        plant = settle("presliding", (friction, slip), before, command)
        assert plant.position[0] - command == pytest.approx([side * friction / GAIN] * 2, rel=0.06)


def test_presliding_is_the_same_with_large_steps():
    commands = path((0.0262, 0.02, 0.2), (0.0268, 0.01, 0.2), (0.0255, 0.01, 0.2))
    for slip in (1e-5, 1e-4):
        use = [(get_effect("presliding"), [0.05, slip], "", [0])]
        fast, reference = (rollout(1, use, tier, commands).position for tier in ("fast", "reference"))
        base = rollout(1, commands=commands).position
        assert np.abs(fast - reference).max() < 0.04 * np.abs(reference - base).max()


@pytest.mark.parametrize("step", [3e-4, 2e-3])
def test_smooth_friction_lets_the_finger_creep(step):
    """Overdamped, it goes by kp e = F_c tanh(v / v_c) + c v, with the servo's error e and damping c = 10 N s/m."""
    force, creep, seconds = 0.05, 5e-4, 1.2
    plant = settle("smooth_friction", (force, creep), START_M + step, seconds=seconds)

    def speed(_, left) -> list[float]:
        return [-brentq(lambda v: force * np.tanh(v / creep) + 10 * v - GAIN * left[0], 0, 10.0)]

    expected = solve_ivp(speed, (0, seconds), [step], rtol=1e-8, atol=1e-12).y[0, -1]
    assert START_M + step - plant.position[0] == pytest.approx([expected] * 2, rel=0.08, abs=3e-6)


@pytest.mark.parametrize("speed", [2e-4, 4e-3])
def test_smooth_friction_grows_with_slow_motion_and_is_dry_for_fast(speed):
    force, creep = 0.03, 1e-3
    plant = settle("smooth_friction", (force, creep), 0.030)
    for command in 0.030 + speed * np.arange(1, 1001) * plant.dt:
        plant.advance(np.full((1, 2), command))
    held = force * np.tanh(speed / creep) + 10 * speed
    assert GAIN * (command - plant.position[0]) == pytest.approx([held] * 2, rel=0.04)


def test_smooth_friction_that_falls_at_no_speed_is_dry():
    stub = SimpleNamespace(velocity=np.array([[0.0, 1e-3], [0.0, 1e-3]]))
    added = get_effect("smooth_friction")(np.array([[0.03, 0.0], [0.03, 1e-3]]), DT).attach(stub, np.arange(2)).act()
    np.testing.assert_allclose(added.friction, [[0.03], [0.0]])
    np.testing.assert_allclose(added.damping, [[0.0, 0.0], [30.0, 0.03 * np.tanh(1.0) / 1e-3]], rtol=1e-9)


def test_smooth_friction_is_the_same_with_large_steps():
    commands = path((0.0262, 0.02, 0.4), (0.0268, 0.01, 0.4), (0.0255, 0.01, 0.4))
    use = [(get_effect("smooth_friction"), [0.05, 5e-4], "", [0])]
    fast, reference = (rollout(1, use, tier, commands).position for tier in ("fast", "reference"))
    assert np.abs(fast - reference).max() < 0.04 * np.abs(reference - rollout(1, commands=commands).position).max()


@pytest.mark.parametrize("excess", [5.0, -5.0])
def test_direction_friction_lags_in_one_direction(excess):
    """On a ramp the servo's spring holds damping (9 + 1 N s/m, and the excess) times speed."""
    plant, speed = settle("direction_friction", (excess,), 0.035), 0.004
    for side in (1, -1):  # opening, closing
        for command in 0.035 + side * (speed * np.arange(1, 1001) * plant.dt - (0.0 if side > 0 else 0.008)):
            plant.advance(np.full((1, 2), command))
        damping = 10 + (abs(excess) if side * excess > 0 else 0)
        assert GAIN * side * (command - plant.position[0]) == pytest.approx([damping * speed] * 2, rel=0.03)


@pytest.mark.parametrize(("damping", "speed"), [(5.0, 0.004), (5.0, 0.008), (12.0, 0.004)])
def test_viscous_friction_lags_in_proportion_to_speed(damping, speed):
    """On a ramp the servo's spring holds damping (9 + 1 N s/m, and that besides) times speed."""
    plant = settle("viscous_friction", (damping,), 0.035)
    for command in 0.035 - speed * np.arange(1, round(0.008 / speed / plant.dt)) * plant.dt:
        plant.advance(np.full((1, 2), command))
    assert GAIN * (plant.position[0] - command) == pytest.approx([(10 + damping) * speed] * 2, rel=0.03)


@pytest.mark.parametrize("speed", [3e-4, 2e-3, 8e-3])
def test_smooth_stiction_is_the_stribeck_curve_over_speed(speed):
    """On a ramp the servo's spring holds the friction of its speed, and the damping of 10 N s/m."""
    breakaway, share, stribeck, creep = 0.05, 0.4, 3e-3, 5e-4
    plant = settle("smooth_stiction", (breakaway, share, stribeck, creep), 0.030)
    for command in 0.030 + speed * np.arange(0.0, min(2.4, 0.01 / speed), plant.dt):
        plant.advance(np.full((1, 2), command))
    held = breakaway * (share + (1 - share) * np.exp(-((speed / stribeck) ** 2))) * np.tanh(speed / creep)
    assert GAIN * (command - plant.position[0]) == pytest.approx([held + 10 * speed] * 2, rel=0.05)


@pytest.mark.parametrize(("simple", "sizes"), [("smooth_friction", (0.05, 5e-4)), ("stiction", (0.05, 0.4, 3e-3))])
def test_smooth_stiction_is_what_it_contains(simple, sizes):
    (nested,) = (one for one in get_effect("smooth_stiction").contains if one.effect == simple)
    values = {"stribeck_m_s": 3e-3} | nested.at
    values |= {own: sizes[get_effect(simple).index(its)] for own, its in nested.same.items()}
    commands = path((0.0262, 0.02, 0.4), (0.0268, 0.01, 0.4))
    rich = [values[p.name] for p in get_effect("smooth_stiction").parameters]
    one, other = (
        rollout(1, [(get_effect(name), list(at), "", [0])], commands=commands).position
        for name, at in ((simple, sizes), ("smooth_stiction", rich))
    )
    np.testing.assert_allclose(one, other, atol=1e-9)


@pytest.mark.parametrize("coefficient", [0.05, 0.2])
def test_smooth_load_friction_takes_its_share_until_it_has_crept(coefficient):
    """Where v is well below v_c the motor's force F and the pads' P differ by |f| = c (F + P) tanh(v / v_c)."""
    dry, creeping = (
        settle("smooth_load_friction", (coefficient, creep), 0.0245, 0.0235, 0.0225) for creep in (0.0, 1e-3)
    )
    motor = GAIN * (dry.position[0] - 0.0225)
    assert dry.pad_force[0] == pytest.approx(motor * (1 - coefficient) / (1 + coefficient), rel=0.04)
    at_rest = GAIN * (creeping.position[0] - 0.0225)
    assert creeping.pad_force[0] == pytest.approx(at_rest, rel=0.02)


@pytest.mark.parametrize(("variant", "load"), [("carried", 0.5), ("pressed", 0.2), ("driven", 0.3)])
def test_smooth_load_friction_is_a_damping_by_the_load(variant, load):
    stub = SimpleNamespace(
        velocity=np.array([[0.0, 1e-3]]), motor_force=np.array([[-0.3, -0.3]]), outside_force=np.array([[0.2, 0.2]]),
        rotor_inertia=np.zeros((1, 2)),
    )  # fmt: skip
    added = make("smooth_load_friction", 0.1, 1e-3, variant=variant).attach(stub, np.array([0])).act()
    np.testing.assert_allclose(added.damping, [[100 * load, 100 * load * np.tanh(1.0)]], rtol=1e-9)
    np.testing.assert_allclose(added.friction, 0)
