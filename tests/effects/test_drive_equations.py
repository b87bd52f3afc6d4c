"""Effects of commands and drives, each against its equation once more: on signals, and as a user sees it."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.signal import lfilter

from forcegrasp.effects import get_effect
from forcegrasp.effects.for_gripper import effect_of
from forcegrasp.physics.gripper_file import load_gripper
from forcegrasp.physics.plant import Plant

from .rollouts import START_M, make_plant, path, rollout, start
from .signals import DT, GAIN, T, butterworth, filtered, make, send, settle, wave


@pytest.mark.parametrize("steps", [1, 3, 12.25, 30.5])
def test_command_delay_shifts_by_exactly_d(steps):
    sent = send(make("command_delay", steps * DT), wave(), position=7.0)
    expected = np.interp(T - steps * DT, [-1.0, -DT, *T], [7.0, 7.0, *wave()])
    assert sent == pytest.approx(expected, abs=1e-12)


def test_command_delay_shifts_all_motion_alike():
    commands = path((0.0222, 1.0, 0.4), (0.026, 0.05, 0.4))
    late = rollout(1, [(get_effect("command_delay"), [0.08], "", [0])], commands=commands)
    base = rollout(1, commands=commands)
    assert late.position[2:] == pytest.approx(base.position[:-2], abs=1e-6)  # the object settles meanwhile
    assert late.force[2:] == pytest.approx(base.force[:-2], abs=5e-3)


def test_command_deadband_drops_small_changes():
    ramp = np.linspace(0.0, 0.01, 101)
    held = send(make("command_deadband", 0.00035, variant="held"), ramp)
    expected = np.floor(np.arange(101) / 4) * 4e-4  # every fourth increment of 0.1 mm is more than 0.35 mm away
    assert held == pytest.approx(expected, abs=1e-12)
    near, dropped = send(make("command_deadband", 0.00035), ramp, position=0.005), np.abs(ramp - 0.005) <= 0.00035
    assert np.array_equal(near[~dropped], ramp[~dropped])
    assert near[dropped] == pytest.approx(0.0046)  # the last one before


def test_command_deadband_goes_by_the_encoder():
    effect, new = make("command_deadband", 0.001), np.array([True])
    stub = SimpleNamespace(position=np.full((1, 2), 0.01), measured_position=np.full((1, 2), 0.0102))
    for recorded, dropped in ((None, True), (np.full((1, 2), 0.0097), False)):
        stub.recorded_position = recorded
        sent = effect.attach(stub, np.array([0])).command(np.full((1, 2), 0.0111), new)
        assert np.all((sent == 0.01) == dropped)


def test_command_deadband_decides_on_new_commands_only():
    """A command that was dropped is not passed on later because the finger moved meanwhile."""
    sent = send(make("command_deadband", 0.001), np.full(20, 0.0105), np.linspace(0.01, 0.0, 20), every=100)
    assert np.all(sent == 0.01)


@pytest.mark.parametrize(("name", "value"), [("actuator_lag", 0.05), ("rate_limit", 0.01), ("command_delay", 0.02)])
def test_what_slows_a_command_starts_from_where_the_finger_stands(name, value):
    np.testing.assert_allclose(send(make(name, value), np.full(30, 0.03), position=0.03), 0.03, rtol=1e-12)


def test_a_dropped_command_is_not_taken_up_while_it_is_held():
    plant = Plant(load_gripper("tiago"), 1, threads=1)
    plant.attach([(make("command_deadband", 0.0003), np.array([0]))])
    plant.reset(np.arange(1), np.zeros(1), np.full((1, 2), 0.044))
    plant.advance(np.full((1, 2), 0.03), 30)
    assert (plant.position > 0.035).all()  # on the way
    plant.advance(plant.position.copy(), 1000)
    np.testing.assert_allclose(plant.position, 0.03, atol=1e-5)


def test_command_deadband_comes_before_a_delay():
    """Both together do as the dead band alone, later; behind the delay it would see a command's age as its own."""
    uses = [(get_effect("command_delay"), [0.05], "", [0]), (get_effect("command_deadband"), [0.0003], "held", [0])]
    plant = make_plant(1, uses)
    start(plant, [0])
    for command in (START_M, START_M - 0.001):
        plant.advance(np.full((1, 2), command), round(0.04 / plant.dt))
    assert plant.position[0, 0] == pytest.approx(START_M, abs=1e-7)
    plant.advance(np.full((1, 2), START_M - 0.001), 200, fresh=False)
    assert plant.position[0, 0] < START_M - 0.0009


@pytest.mark.parametrize("height", [0.004, 0.016])
def test_rate_limit_makes_ramps(height):
    step = np.where(T < 0.1, 0.0, height)
    sent = send(make("rate_limit", 0.02), step)
    expected = np.clip(0.02 * (T - 0.1 + DT), 0, height)
    assert sent == pytest.approx(expected, abs=1e-12)
    assert send(make("rate_limit", 0.02), 0.019 * T) == pytest.approx(0.019 * T, abs=1e-12)


@pytest.mark.parametrize("height", [0.0006, 0.016])
def test_rate_limited_lag_makes_ramps_that_end_in_an_exponential(height):
    """What is left of a step falls by v until it is v τ, and from there by its τ-th part."""
    rate, tau = 0.02, 0.05
    left = height - send(make("rate_limited_lag", rate, tau), np.where(T < 0.1, 0.0, height))[T >= 0.1]
    ramp = max(height - rate * tau, 0.0) / rate  # seconds that it takes
    since = T[T >= 0.1] - 0.1 + DT
    expected = np.where(
        since < ramp, height - rate * since, min(height, rate * tau) * np.exp(-np.maximum(since - ramp, 0) / tau)
    )
    assert left == pytest.approx(expected, abs=3e-5 if ramp else 1e-12)  # where it bends lies within a step


def test_rate_limited_lag_is_a_rate_limit_or_a_lag_where_the_other_is_not_there():
    command = 0.01 * wave()
    np.testing.assert_array_equal(
        send(make("rate_limited_lag", 0.02, 0.0), command), send(make("rate_limit", 0.02), command)
    )
    np.testing.assert_allclose(
        send(make("rate_limited_lag", np.inf, 0.05), command), send(make("actuator_lag", 0.05), command), rtol=1e-12
    )


@pytest.mark.parametrize("tau", [0.005, 0.03])
def test_a_drives_filter_may_be_a_butterworth_of_second_order(tau):
    """SciPy's filter with the same corner, of a command that stays for a step."""
    command = wave() - wave()[0]
    out = send(make("actuator_lag", tau, variant="butterworth"), command)
    assert out == pytest.approx(butterworth(command, tau), abs=1e-9)
    assert send(make("actuator_lag", 0.0, variant="butterworth"), wave()) == pytest.approx(wave(), abs=1e-12)


@pytest.mark.parametrize(("tau", "inertia"), [(0.02, 0.05), (0.06, 0.015), (0.2, 0.005), (0.003, 0.3), (0.05, 1e-5)])
def test_a_second_order_lag_is_that_of_control_theory(tau, inertia):
    """It rings, is damped just so that it does not, is two lags in a row, rings for long, or hardly has inertia."""
    command = wave() - wave()[0]
    out = send(make("second_order_lag", tau, inertia), command)
    assert out == pytest.approx(filtered(command, [1.0], [tau * inertia, tau, 1.0]), abs=1e-8)


def test_a_second_order_lag_without_inertia_is_of_first_order():
    without = send(make("second_order_lag", 0.05, 0.0), wave())
    np.testing.assert_allclose(without, send(make("actuator_lag", 0.05), wave()), rtol=1e-12)
    np.testing.assert_array_equal(send(make("second_order_lag", 0.0, 1.0), wave()), wave())


def test_actuator_lag_is_an_exponential():
    tau = 0.05
    sent = send(make("actuator_lag", tau), np.where(T < 0.1, 0.0, 1.0))
    assert sent == pytest.approx(np.where(T < 0.1, 0.0, 1 - np.exp(-(T - 0.1 + DT) / tau)), abs=1e-12)
    keep = np.exp(-DT / tau)
    assert send(make("actuator_lag", tau), wave()) == pytest.approx(lfilter([1 - keep], [1, -keep], wave()), abs=1e-12)


@pytest.mark.parametrize("target", [0.030, 0.0225])
def test_motor_offset_is_held_by_the_servo(target):
    """At rest F_0 + kp (u − q) = 0 in free air, and what the pads feel in contact."""
    offset = np.array([0.03, -0.02])
    plant = settle("motor_offset", tuple(offset), target)
    held = GAIN * (plant.position[0] - target) - offset
    assert held == pytest.approx(plant.pad_force[0], rel=0.03, abs=2e-5)
    again = settle("motor_offset", tuple(offset), 0.034 if target == 0.030 else 0.024, target, seconds=2.4)
    assert again.position == pytest.approx(plant.position, abs=3e-5)  # wherever it comes from


@pytest.mark.parametrize("target", [0.030, 0.034])
@pytest.mark.parametrize("spring", [(4.0, 0.045), (30.0, 0.02)])
def test_return_spring_is_held_by_the_servo(spring, target):
    """At rest kp (u − q) = k (q − q_0)."""
    stiffness, rest = spring
    expected = (GAIN * target + stiffness * rest) / (GAIN + stiffness)
    assert settle("return_spring", spring, target).position[0] == pytest.approx([expected] * 2, abs=2e-5)


@pytest.mark.parametrize(("stiffness", "damping"), [(0.2, 0.0), (0.0, -0.3), (0.1, 0.1)])
def test_motor_asymmetry_lets_fingers_lag_by_what_damps_over_what_pulls(stiffness, damping):
    """On a ramp of speed v, ``K (u − q) = B v``; pressing, each finger stands off by its own spring."""
    speed, sides = 0.004, np.array([1.0, -1.0])
    plant = make_plant(1, [(get_effect("motor_asymmetry"), (stiffness, damping), "", [0])], "reference")
    start(plant, [0], np.zeros(1))
    for step in range(round(1.5 / plant.dt)):
        target = START_M + speed * plant.dt * step
        plant.advance(np.full((1, 2), target))
    springs, dampers = GAIN * (1 + stiffness * sides), (9.0 + 1.0) * (1 + damping * sides)
    assert target + speed * plant.dt - plant.position[0] == pytest.approx(dampers / springs * speed, rel=0.01)
    pressing = settle("motor_asymmetry", (stiffness, damping), 0.0225)
    assert springs * (pressing.position[0] - 0.0225) == pytest.approx(pressing.pad_force[0], rel=0.03)
    assert np.ptp(pressing.pad_force) < 0.03 * pressing.pad_force.mean()  # the object goes where they are alike


@pytest.mark.parametrize("limit", [0.1, 0.25])
def test_force_limit_is_a_plateau(limit):
    for target in (0.012, 0.002):
        force = settle("force_limit", (limit,), target).pad_force[0]
        assert force.mean() == pytest.approx(limit, rel=0.01)
        assert force == pytest.approx([limit] * 2, rel=0.03)  # readings have tangential parts in them
    soft = settle("force_limit", (limit,), 0.0244)
    assert soft.pad_force[0] == pytest.approx(settle("", (), 0.0244).pad_force[0], rel=1e-4)


# --- presliding, direction, limits of the loop -----------------------------------------------------------------


def test_back_emf_is_the_line_of_a_motor():
    effect, wide = make("back_emf", 0.2, 0.05), (np.full((1, 2), -1.0), np.full((1, 2), 1.0))
    for speed in (-0.1, -0.02, 0.0, 0.03, 0.05, 0.2):
        stub = SimpleNamespace(velocity=np.full((1, 2), speed), inertia=np.full((1, 2), np.inf))
        low, high = effect.attach(stub, np.array([0])).motor_range(*wide)
        assert high == pytest.approx(np.full((1, 2), min(0.2 * (1 - speed / 0.05), 1.0)))
        assert low == pytest.approx(np.full((1, 2), min(max(-0.2 * (1 + speed / 0.05), -1.0), high[0, 0])))


@pytest.mark.parametrize("gripper", ["tiago", "robotiq_2f85"])
@pytest.mark.parametrize("side", [-1, 1])
def test_back_emf_has_a_highest_speed(gripper, side):
    """A large step ends in F_s (1 − v / v_0) = c v, with the joint's damping c; also of a motor that is turned."""
    plant = Plant(load_gripper(gripper), 2, threads=1)
    stroke, inertia = plant.gripper.stroke, plant.model.dof_M0[plant.motor_dofs][0]
    highest = 0.4 * stroke  # per second
    stall = inertia * highest / 0.05  # which is reached soon
    effect = get_effect("back_emf")(np.array([[stall, highest]]), plant.dt)
    plant.attach([(effect, np.array([1]))])
    begin = 0.65 if side > 0 else 0.98
    for parameter, value in (("dof_damping", 0.0), ("dof_frictionloss", 0.0)):
        plant.base(parameter)[:], plant.field(parameter)[:] = value, value
    plant.reset(np.arange(2), np.zeros(2), np.full((2, plant.motors), begin * stroke))
    speeds = []
    for _ in range(round(0.8 / plant.dt)):
        plant.advance(np.full((2, plant.motors), stroke if side > 0 else 0.0))
        speeds.append(side * plant.velocity[1, 0])
    assert max(speeds) == pytest.approx(highest, rel=0.03)
    assert side * plant.velocity[0, 0] < highest or plant.position[0, 0] == pytest.approx(stroke if side > 0 else 0)


def test_back_emf_at_any_size_is_stable():
    values = [[stall, speed] for stall in (0.005, 0.5, 50.0) for speed in (0.001, 10.0)]
    trace = rollout(6, [(get_effect("back_emf"), values, "", range(6))])
    slow = np.diff(trace.true_position[:, 4, 0])
    assert np.abs(slow).max() < 0.04 * 0.001 * 1.1  # m in a period
    assert trace.distance(trace) == 0


def test_position_deadband_gives_no_force_within_it():
    near, far = np.full(5, 0.0104), np.full(5, 0.0106)
    assert np.array_equal(send(make("position_deadband", 5e-4), near, position=0.01), np.full(5, 0.01))
    assert np.array_equal(send(make("position_deadband", 5e-4), far, position=0.01), far)


def test_position_deadband_that_subtracts_lets_the_force_grow_from_zero():
    band, error = 5e-4, np.array([-2e-3, -6e-4, -4e-4, 0.0, 3e-4, 6e-4, 2e-3])
    sent = send(make("position_deadband", band, variant="subtract"), 0.01 + error, position=0.01)
    assert sent - 0.01 == pytest.approx(np.sign(error) * np.maximum(np.abs(error) - band, 0), abs=1e-15)


@pytest.mark.parametrize("knee", [0.0, 0.4])
def test_smooth_force_limit_bends_what_is_asked(knee):
    """At rest the pads feel what the motor gives of kp (u − q)."""
    limit, command = 0.3, 0.019
    uses = [(get_effect("smooth_force_limit"), [limit, knee], "", [0]), (get_effect("force_limit"), [limit], "", [1])]
    plant = make_plant(2, uses, "reference")
    start(plant, [0, 1], np.zeros(2))
    plant.advance(np.full((2, 2), command), 3000)
    asked = GAIN * (plant.position[0] - command)
    assert np.all(asked > 1.2 * limit)
    assert plant.asked_force[0] == pytest.approx(-asked, rel=1e-3)
    given = limit * np.tanh(asked / limit) if knee else np.full(2, limit)
    assert -plant.motor_force[0] == pytest.approx(given, rel=0.02)
    assert plant.pad_force[0].sum() == pytest.approx(given.sum(), rel=0.02)  # the table holds the object a little
    assert (np.max(np.abs(plant.pad_force[0] - plant.pad_force[1])) < 1e-12) == (knee == 0)
    start(plant, [0, 1], np.zeros(2))
    plant.advance(plant.position + limit / GAIN)  # it opens
    assert plant.motor_force[0] == pytest.approx(limit * np.tanh(1) if knee else limit, rel=0.02)


def test_position_deadband_stops_short_and_lets_itself_be_pushed():
    band, command = 8e-4, 0.032
    for before, side in ((command + 0.008, 1), (command - 0.004, -1)):
        plant = settle("position_deadband", (band,), before, command)
        short = side * (plant.position[0] - command)
        assert np.all((short > 0.3 * band) & (short <= band))
    pushes = [
        (get_effect("position_deadband"), [band], "", [0]),
        (get_effect("motor_offset"), [-0.01, -0.01], "", [0]),
    ]
    plant = make_plant(1, pushes, "reference")
    start(plant, [0], np.zeros(1))
    for at in (command + 0.004, command):
        plant.advance(np.full((1, 2), at), 3000)
    assert plant.position[0] == pytest.approx(
        [command - band] * 2, rel=1e-3
    )  # 10 mN, of 80 mN that friction would take


@pytest.mark.parametrize(("share", "frequency"), [(0.3, 8.0), (1.0, 4.0)])
def test_elastic_transmission_is_two_masses(share, frequency):
    """A step of a servo, against the two equations of motion integrated by another program."""
    plant = Plant(load_gripper("so101_jaw"), 1, threads=1, step_factor=0.25)
    kind = get_effect("elastic_transmission")
    plant.attach([(kind(np.array([[share, frequency]]), plant.dt), np.array([0]))])
    plant.reset(np.arange(1), np.zeros(1))
    inertia, gain, damping, goal = plant.model.dof_M0[0], 17.8, 0.6, 0.3
    omega = 2 * np.pi * frequency

    def motion(_: float, state: np.ndarray) -> list[float]:
        q, v, x, w = state
        pull = share * inertia * (omega**2 * (x - q) + 0.2 * omega * (w - v))
        return [v, (gain * (goal - q) - damping * v + pull) / inertia, w, -pull / (share * inertia)]

    times = plant.dt * np.arange(1, 2001)
    expected = solve_ivp(motion, (0, times[-1]), [0, 0, 0, 0], t_eval=times, rtol=1e-8, atol=1e-10).y[0]
    seen = []
    for _ in times:
        plant.advance(np.full((1, 1), goal))
        seen.append(plant.position[0, 0])
    assert np.abs(np.array(seen) - expected).max() < 0.02 * goal
    assert np.abs(expected - goal).max() > 0.15 * goal


@pytest.mark.parametrize("lag", [0.003, 0.02])
@pytest.mark.parametrize("variant", ["difference", "filter"])
def test_velocity_lag_damps_by_a_late_velocity(variant, lag):
    """A step of a servo that was moving already, against its equation of motion in small steps of an own."""
    plant, start_rad_s = Plant(load_gripper("so101_jaw"), 1, threads=1, step_factor=0.25), 0.5
    plant.attach([(get_effect("velocity_lag")(np.array([[lag]]), plant.dt, variant), np.array([0]))])
    plant.reset(np.arange(1), np.zeros(1), np.zeros((1, 1)), np.full((1, 1), start_rad_s))
    inertia, goal, step, window = plant.model.dof_M0[0], 0.3, plant.dt, round(2 * lag / plant.dt)
    ways = [start_rad_s * step * k for k in range(-window, 1)]  # before the start it moved as at the start
    q, v, late, seen, expected = 0.0, start_rad_s, start_rad_s, [], []
    for _ in range(1500):
        late = late + (1 - np.exp(-step / lag)) * (v - late) if variant == "filter" else 0.0
        known = (q - ways[-1 - window]) / (2 * lag) if variant == "difference" else late
        v += step * (17.8 * (goal - q) - 0.6 * known) / inertia
        q += step * v
        ways.append(q)
        expected.append(q)
        plant.advance(np.full((1, 1), goal))
        seen.append(plant.position[0, 0])
    assert np.abs(np.array(seen) - expected).max() < 0.02 * goal
    assert np.abs(seen - np.array(seen)[-1]).max() > 0.1 * goal


def test_velocity_lag_leaves_steady_motion_as_it_is():
    plant = Plant(load_gripper("so101_jaw"), 2, threads=1)
    plant.attach([(get_effect("velocity_lag")(np.array([[0.02]]), plant.dt), np.array([1]))])
    plant.reset(np.arange(2), np.zeros(2))
    apart = []
    for k in range(3000):
        plant.advance(np.full((2, 1), 0.2 * k * plant.dt))
        apart.append(abs(float(np.diff(plant.position[:, 0])[0])))
    assert max(apart) > 1e-3 > 1e3 * apart[-1]


@pytest.mark.parametrize("frequency", [0.5, 100.0])
@pytest.mark.parametrize("share", [0.1, 4.0])
def test_elastic_transmission_is_stable(share, frequency):
    plant = Plant(load_gripper("so101_jaw"), 1, threads=1)
    plant.attach([(get_effect("elastic_transmission")(np.array([[share, frequency]]), plant.dt), np.array([0]))])
    plant.reset(np.arange(1), np.zeros(1))
    for command in np.repeat([0.5, -0.5, 0.0], 100):
        plant.advance(np.full((1, 1), command))
        assert np.abs(plant.position).max() < 2
    plant.advance(np.zeros((1, 1)), 2000)
    assert np.abs(plant.position).max() < 0.02


def test_commands_that_are_efforts_rest_at_none():
    """What slows a command starts from no effort where efforts are commanded, wherever the joint stands."""
    mechanism = load_gripper("dfki_pendulum")
    plant = Plant(mechanism, 3, threads=1)
    uses = [
        (effect_of(name, mechanism), np.array([row])) for row, name in enumerate(("command_delay", "actuator_lag"), 1)
    ]
    plant.attach([(kind(np.array([[0.5]]), plant.dt), row) for kind, row in uses])
    plant.reset(np.arange(3), np.zeros(3), np.full((3, 1), 2.0))
    plant.advance(np.zeros((3, 1)), 100)
    assert (plant.position == plant.position[0]).all()
