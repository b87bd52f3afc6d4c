"""Each effect against its own equation, written down a second time: on signals, and in the grasp as a user sees it."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter

from forcegrasp.effects import Effect, catalogue, get_effect
from forcegrasp.physics.gripper_file import load_gripper
from forcegrasp.physics.plant import Plant, write_base

from .rollouts import FORCE_SCALE, START_M, make_plant, path, play, rollout, start

DT = 0.002
T = np.arange(1000) * DT
GAIN = 100.0  # N/m, of the servo
TOUCH_M = 0.025  # where a pad meets the nominal object


def make(name: str, *values: float, variant: str = "") -> Effect:
    return get_effect(name)(np.array([values]), DT, variant)


def read(effect: Effect, left: np.ndarray, right: np.ndarray | None = None) -> np.ndarray:
    """Force readings of a signal, ``(samples, 2)``."""
    both = np.stack([left, left if right is None else right], axis=1)
    return np.array([effect.read_force(f[None])[0] for f in both])


def send(effect: Effect, command: np.ndarray, position: np.ndarray | float = 0.0, every: int = 1) -> np.ndarray:
    """What the actuator gets of the commands, ``(samples,)``, a new one every so many steps."""
    position = np.broadcast_to(position, command.shape)
    out = []
    for i, u in enumerate(command):
        q = np.full((1, 2), position[i])
        stub = SimpleNamespace(position=q, measured_position=q, recorded_position=None)
        effect.attach(stub, np.array([0]))
        out.append(effect.command(np.full((1, 2), u), np.array([i % every == 0]))[0, 0])
    return np.array(out)


def wave(f: float = 1.3) -> np.ndarray:
    return np.sin(2 * np.pi * f * T) + 0.3 * np.sin(2 * np.pi * 3.1 * f * T)


def settle(name: str, values: tuple[float, ...], *targets: float, variant: str = "", seconds: float = 1.6, **more):
    """Steps from one target to the next on the reference tier; the plant as it rests at the last."""
    plant = make_plant(1, [(get_effect(name), values, variant, [0])] if name else [], "reference")
    start(plant, [0], np.zeros(1))
    for target in targets:
        plant.advance(np.full((1, 2), target), round(seconds / plant.dt))
    return plant


# --- command and actuator ------------------------------------------------------------------------------------------


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


def test_actuator_lag_is_an_exponential():
    tau = 0.05
    sent = send(make("actuator_lag", tau), np.where(T < 0.1, 0.0, 1.0))
    assert sent == pytest.approx(np.where(T < 0.1, 0.0, 1 - np.exp(-(T - 0.1 + DT) / tau)), abs=1e-12)
    keep = np.exp(-DT / tau)
    assert send(make("actuator_lag", tau), wave()) == pytest.approx(lfilter([1 - keep], [1, -keep], wave()), abs=1e-12)


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
    assert plant.position[0] == pytest.approx([START_M] * 2, abs=2e-5)  # in 4 s
    plant.advance(np.full((1, 2), START_M + 1.5 * 0.05 / GAIN), 2000)
    assert plant.position[0] == pytest.approx([START_M + 0.5 * 0.05 / GAIN] * 2, abs=2e-5)


def test_stiction_follows_the_stribeck_curve():
    effect = make("stiction", 0.05, 0.4)
    for speed in (0.0, 0.001, 0.002, -0.002, 0.01, 1.0):
        stub = SimpleNamespace(velocity=np.full((1, 2), speed))
        friction = effect.attach(stub, np.array([0])).act().friction
        assert friction == pytest.approx(0.02 + 0.03 * np.exp(-((speed / 0.002) ** 2)), abs=1e-12)


def test_stiction_sticks_then_jumps():
    """On a slow ramp the finger waits until the spring of the servo pulls with F_s, then slips at once."""
    speed, breakaway = 0.0005, 0.15
    plant = settle("stiction", (breakaway, 0.2), START_M)
    ramp, seen = START_M + speed * np.arange(1, 2001) * plant.dt, []
    for command in ramp:
        plant.advance(np.full((1, 2), command))
        seen.append((plant.position[0, 0], plant.velocity[0, 0]))
    position, velocity = np.array(seen).T
    first = np.argmax(position > START_M + 2e-5)
    assert ramp[first] - START_M == pytest.approx(breakaway / GAIN, rel=0.1)
    assert velocity[first:].max() > 5 * speed
    assert velocity[first + np.argmax(velocity[first:]) :].min() < 0.1 * speed  # and sticks again


@pytest.mark.parametrize("limit", [0.1, 0.25])
def test_force_limit_is_a_plateau(limit):
    for target in (0.012, 0.002):
        force = settle("force_limit", (limit,), target).pad_force[0]
        assert force.mean() == pytest.approx(limit, rel=0.01)
        assert force == pytest.approx([limit] * 2, rel=0.03)  # readings have tangential parts in them
    soft = settle("force_limit", (limit,), 0.0244)
    assert soft.pad_force[0] == pytest.approx(settle("", (), 0.0244).pad_force[0], rel=1e-4)


# --- transmission and contact --------------------------------------------------------------------------------------


def test_backlash_loses_its_gap_after_each_reversal():
    gap = 0.0008
    plant, pads = settle("backlash", (gap,), 0.0287, 0.0279), []
    motor = np.linspace(0.0279, 0.0291, 13)
    for command in motor:
        plant.advance(np.full((1, 2), command), 800)
        pads.append(plant.position[0, 0] + plant.pad_shift_m[0, 0])
    assert np.array(pads) == pytest.approx(np.maximum(0.0279 + gap / 2, motor - gap / 2), abs=1e-6)


def test_backlash_makes_contact_late_by_half_the_gap():
    base, late = settle("", (), 0.0235), settle("backlash", (0.0004,), 0.0235 - 0.0002)
    # the pad is where it is without the gap, and the motor 0.2 mm further; its servo pulls as before
    assert late.pad_force[0] == pytest.approx(base.pad_force[0], rel=0.01)
    assert late.position[0] == pytest.approx(base.position[0] - 0.0002, abs=2e-6)


def test_backlash_keeps_the_force_while_the_motor_crosses():
    closed = (0.0245, 0.023, 0.022, 0.021)  # step by step, lest the motor overshoots
    for variant, keeps in (("play", True), ("loose", False)):
        before = settle("backlash", (0.001,), *closed, variant=variant)
        after = settle("backlash", (0.001,), *closed, 0.0215, variant=variant)
        if keeps:
            assert after.pad_force[0] == pytest.approx(before.pad_force[0], rel=0.06)
            assert after.position[0] - before.position[0] == pytest.approx([0.00045] * 2, abs=5e-5)
        else:
            assert np.all(after.pad_force < 0.8 * before.pad_force)


def test_backlash_of_the_command_moves_the_encoder_late():
    gap = 0.0006
    plant = settle("backlash", (gap,), 0.0265, variant="command")
    assert plant.position[0] == pytest.approx([0.0265 + gap / 2] * 2, abs=2e-6)
    plant.advance(np.full((1, 2), 0.0265 + 0.9 * gap), 800)
    assert plant.position[0] == pytest.approx([0.0265 + gap / 2] * 2, abs=2e-6)
    plant.advance(np.full((1, 2), 0.0265 + 2 * gap), 800)
    assert plant.position[0] == pytest.approx([0.0265 + 1.5 * gap] * 2, abs=2e-6)


def test_pads_that_moved_inward_still_touch():
    """Lost motion moves pads inward at a release, out of the volumes that their bodies had when compiled."""
    closed = (0.0245, 0.0205, 0.0190)
    before = settle("backlash", (0.006,), *closed, closed[-1])
    after = settle("backlash", (0.006,), *closed, closed[-1] + 0.0052)
    assert np.all(after.pad_shift_m < -0.002)
    assert after.pad_force[0] == pytest.approx(before.pad_force[0], rel=0.06)


@pytest.mark.parametrize("compliance", [0.0005, 0.002])
def test_finger_compliance_deflects_in_proportion_to_force(compliance):
    plant = settle("finger_compliance", (compliance,), 0.0215)
    force = plant.pad_force[0]
    assert plant.pad_shift_m[0] == pytest.approx(compliance * force, rel=1e-3)
    rigid = [settle("", (), target) for target in np.linspace(0.0205, 0.0225, 9)]
    pad = np.interp(force[0], *np.array([(p.pad_force[0, 0], p.position[0, 0]) for p in rigid][::-1]).T)
    assert plant.position[0, 0] + compliance * force[0] == pytest.approx(pad, abs=1e-5)
    assert plant.position[0, 0] < rigid[4].position[0, 0]  # the encoder runs ahead


class Pads:
    """Stands for a plant with both pads at given places along the grasp axis, and motors of any strength."""

    pad_shift_m = np.zeros((1, 2))

    def __init__(self, distance: np.ndarray, force: np.ndarray | float, centre: float = 0.0) -> None:
        pads = np.array([-1, 1]) * distance + centre  # the left one stands on the negative side
        self.pad_position, self.object_position = (pads * [-1, 1])[None], np.array([centre])
        self.pad_force = np.broadcast_to(np.asarray(force, float), (1, 2))

    def strongest_press(self, rows: np.ndarray) -> np.ndarray:
        return np.full((len(rows), 2), np.inf)


def press(effect: Effect, distance: np.ndarray, force: np.ndarray, centre: np.ndarray | float = 0.0) -> np.ndarray:
    """What the effect adds to the true force while pads stand so far from the object's middle, ``(samples, 2)``.

    Args:
      effect: of the contact.
      distance: metres, ``(samples, 2)``.
      force: of the contact itself, newtons, ``(samples, 2)``.
      centre: of the object, metres, ``(samples,)``.
    """
    added, everywhere = [], np.broadcast_to(centre, len(distance))
    for row, pushed, middle in zip(distance, force, everywhere, strict=True):
        plant = Pads(row, pushed, middle)
        push = effect.attach(plant, np.array([0])).act()
        added.append(effect.interaction(plant.pad_force)[0] - plant.pad_force[0])
        assert push.finger_push_n[0] == pytest.approx(added[-1], abs=1e-12)  # what presses opens the fingers
        along_axis = push.finger_push_n[0] * [-1, 1]  # opening moves the left finger to the negative side
        assert push.object_push_n[0] == pytest.approx(-along_axis.sum(), abs=1e-12)  # to every push its opposite
    return np.array(added)


def depth_of(speeds: tuple[float, float]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pads that come from 1 mm away, press into a surface at 20 mm and leave: distance, contact force and depth."""
    depth = np.outer(0.002 * np.sin(2 * np.pi * 0.9 * T - 0.5), speeds)
    first = np.argmax(depth > 0, axis=0)  # the surface is where a pad is when it first feels something
    felt = depth - depth[first, [0, 1]]
    return 0.02 - depth, np.where(depth > 0, 0.1 + 50 * depth, 0.0), np.where(T[:, None] < T[first], 0.0, felt)


@pytest.mark.parametrize(("stiffness", "tau"), [(80.0, 0.3), (400.0, 0.05)])
def test_viscoelastic_contact_is_a_maxwell_branch_that_only_pushes(stiffness, tau):
    distance, force, depth = depth_of((1.0, 0.4))
    centre = 0.003 * np.sin(5 * T)  # the object moves, and the pads with it
    added = press(make("viscoelastic_contact", stiffness, tau), distance, force, centre)
    keep = np.exp(-DT / tau)
    relaxed = lfilter([1 - keep], [1, -keep], np.maximum(depth, 0), axis=0)
    expected = stiffness * np.maximum(np.maximum(depth, 0) - relaxed, 0)
    assert expected.max() > 0.02
    assert (expected[depth > 0] == 0).any()  # while it is relieved
    assert added == pytest.approx(expected, abs=1e-9)


def test_viscoelastic_force_of_a_sudden_squeeze_is_an_exponential():
    squeeze, tau = 0.0005, 0.2
    distance = np.full((1000, 2), 0.02)
    distance[1:] -= squeeze
    added = press(make("viscoelastic_contact", 100.0, tau), distance, np.full((1000, 2), 0.1))
    expected = 100.0 * squeeze * np.exp(-T[1:] / tau)
    assert added[1:] == pytest.approx(np.repeat(expected[:, None], 2, axis=1), rel=1e-9)


def test_viscoelastic_contact_relaxes_to_the_elastic_one():
    """In a long hold force decays while the finger creeps in, to what there is without the branch."""
    values = (300.0, 0.5)
    early = settle("viscoelastic_contact", values, 0.0215, seconds=0.3)
    late = settle("viscoelastic_contact", values, 0.0215, seconds=8)
    elastic = settle("", (), 0.0215, seconds=8)
    assert np.all(late.force < early.force - 0.01)
    assert np.all(late.position < early.position - 1e-4)
    assert late.force == pytest.approx(elastic.force, rel=0.02)  # they creep themselves, by some µm/s
    assert late.position == pytest.approx(elastic.position, abs=2e-5)
    # whatever the pads push is what the servo holds
    assert late.force == pytest.approx(GAIN * (late.position - 0.0215) * FORCE_SCALE, rel=0.03)


def test_stiffening_contact_steepens_the_impedance():
    """At rest F ∝ r d² / (1 − d) with d = d_max y, y = (2r/ρ)^p / 2 below the middle; so the ratio is known."""
    rho, power = 0.0065, 2 + 1.5

    def rest(values: tuple[float, ...]) -> np.ndarray:
        plants = [settle("stiffening_contact", values, target) for target in (0.0226, 0.0222, 0.0218)]
        return np.array([(TOUCH_M - p.position[0, 0], p.pad_force[0, 0]) for p in plants]).T

    def shape(r: np.ndarray, p: float) -> np.ndarray:
        d = 0.99 * 0.5 * (2 * r / rho) ** p
        return r * d**2 / (1 - d)

    for values, p in (((0.0, 0.0), 2.0), ((1.5, 0.0), power)):
        squeeze, force = rest(values)
        assert np.all((squeeze > 0) & (squeeze < rho / 2))
        ratio = force / shape(squeeze, p)
        assert ratio == pytest.approx(ratio[0], rel=0.03)


def test_stiffening_spring_is_cubic():
    distance, force, depth = depth_of((1.0, 0.4))
    added = press(make("stiffening_contact", 1.5, 0.05), distance, force, 0.002 * np.cos(3 * T))
    assert added == pytest.approx(0.05 * np.maximum(depth / 1e-3, 0) ** 3, abs=1e-9)


@pytest.mark.parametrize("cubic", [0.02, 0.1])
def test_stiffening_spring_shares_the_load(cubic):
    """At rest the servo holds the contact and the spring, which are compressed alike."""
    plant = settle("stiffening_contact", (0.0, cubic), 0.0249, 0.0247, 0.0245, 0.023, 0.0215)
    spring = plant.force / FORCE_SCALE - plant.pad_force
    assert spring == pytest.approx(cubic * ((TOUCH_M - plant.position) / 1e-3) ** 3, rel=0.08)
    assert plant.force == pytest.approx(GAIN * (plant.position - 0.0215) * FORCE_SCALE, rel=0.03)
    assert np.all(spring > 0.1 * plant.pad_force)


def test_stiffening_spring_throws_no_finger_out():
    """As hard as it may be, on a small object that turns away from the pads, with 8 ms steps."""
    plant = make_plant(1, [(get_effect("stiffening_contact"), (1.033, 4.623), "", [0])], "fast")
    base = {"position_gain": 105.5, "velocity_gain": -26.45, "rho_m": 0.01612, "radius_m": 0.008184}
    values = {name: np.array([value]) for name, value in (base | {"force_scale": 16.62, "offset_m": 0.02111}).items()}
    plant.reset(np.arange(1), write_base(plant, np.arange(1), values))
    for _ in range(150):
        plant.advance(np.maximum(plant.measured_position - 0.003, 0.0), round(0.04 / plant.dt))
    assert not plant.warnings().any()
    assert (plant.position < 0.05).all()


def test_adhesion_is_full_in_contact_and_fades_over_its_distance():
    gaps = np.array([0.5, 0.0, -0.3, 0.0, 0.25, 0.5, 0.9, 0.5, 1.1, 0.5, 0.0, -0.1, 0.5]) * 1e-3
    #       not yet | touch, press | ..... pulled, back in part | torn off | near, not felt | touch, away
    force = np.where(gaps < 0, 0.2, 0.0)
    force[1], pull, distance = 1e-3, 0.03, 1e-3
    expected = -pull * np.array([0, 1, 1, 1, 0.75, 0.5, 0.1, 0.5, 0, 0, 0, 1, 0.5])
    both = np.repeat(force[:, None], 2, axis=1)
    added = press(make("adhesion", pull, distance), 0.02 + np.repeat(gaps[:, None], 2, axis=1), both)
    assert added == pytest.approx(np.repeat(expected[:, None], 2, axis=1), abs=1e-9)


def test_adhesion_knows_the_fingers_apart():
    """Left and right bond on their own, and a moving object takes its surface with it."""
    gaps = np.array([[1e-3, 1e-3], [0.0, 1e-3], [0.5e-3, 1e-3], [0.0, 0.0], [0.2e-3, 0.4e-3]])
    force = np.array([[0, 0], [0.1, 0], [0, 0], [0.1, 0.1], [0, 0]])
    added = press(make("adhesion", 0.03, 0.001), 0.02 + gaps, force, np.array([0, 0.001, -0.002, 0.003, 0.001]))
    expected = -0.03 * np.array([[0, 0], [1, 0], [0.5, 0], [1, 1], [0.8, 0.6]])
    assert added == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("pull", [0.02, 0.06])
def test_adhesion_reads_negative_at_release(pull):
    plant = make_plant(1, [(get_effect("adhesion"), [pull, 2e-4], "", [0])], "reference")
    start(plant, [0], np.zeros(1))
    plant.advance(np.full((1, 2), 0.0225), 400)
    lowest, last = np.zeros(2), np.zeros(2)
    for command in np.linspace(0.0225, 0.027, 1500):
        plant.advance(np.full((1, 2), command))
        lowest = np.minimum(lowest, plant.measured_force[0])
        last = np.where(plant.pad_force[0] > 0, command - plant.position[0], last)
    assert lowest == pytest.approx([-pull * FORCE_SCALE] * 2, rel=0.02)
    assert np.all(plant.measured_force == 0)
    # the pads let go when the servo pulls harder than they stick
    assert np.all(last * GAIN > 0.9 * pull)


def test_object_friction_holds_an_off_centre_object():
    def pushed(friction: float) -> tuple[float, float]:
        """How far the object went, and the force on it at the end."""
        plant = make_plant(1, [(get_effect("object_friction"), [friction], "", [0])], "reference")
        start(plant, [0], np.array([0.002]))  # towards the right finger, which touches first
        plant.advance(np.full((1, 2), 0.0255), 4000)  # stops before the left one touches
        assert plant.pad_force[0, 0] == 0
        return 0.002 - plant.object_position[0], plant.pad_force[0, 1]

    way, push = pushed(10.0)
    assert abs(way) < 2e-5  # in 8 s
    assert push > 0.02
    ways = [pushed(share * push)[0] for share in (0.0, 0.3, 0.6, 0.9)]
    assert np.all(np.diff(ways) < -1e-5)
    for share in (0.3, 0.6):  # it stops where the finger pushes no harder than F_t
        assert pushed(share * push)[1] == pytest.approx(share * push, rel=0.1)
    assert pushed(1.2 * push)[0] < 2e-5


# --- sensors -------------------------------------------------------------------------------------------------------


def test_force_crosstalk():
    out = read(make("force_crosstalk", 0.1), wave(), 0 * T)
    assert out == pytest.approx(np.stack([wave(), 0.1 * wave()], axis=1))
    out = read(make("force_crosstalk", -0.2), wave(), wave(2.0))
    assert out == pytest.approx(np.stack([wave() - 0.2 * wave(2.0), wave(2.0) - 0.2 * wave()], axis=1))


def test_force_hysteresis_width():
    """A closed loop of more than the width is a parallelogram: w/2 less while rising, w/2 more while falling."""
    f = 0.5 - 0.5 * np.cos(2 * np.pi * 2 * T)
    out = read(make("force_hysteresis", 0.1, 0.0), f)[:, 0]
    second = T >= 0.5
    rising = np.gradient(f) > 0
    plateau = (f < 0.1) | (f > 0.9)
    assert out[second & rising & ~plateau] == pytest.approx(f[second & rising & ~plateau] - 0.05, abs=1e-12)
    assert out[second & ~rising & ~plateau] == pytest.approx(f[second & ~rising & ~plateau] + 0.05, abs=1e-12)


@pytest.mark.parametrize("speed", [0.5, 4.0])
def test_force_hysteresis_share(speed):
    """Falling, the reading is (1 + h) times the force once it left the peak's level, at any speed."""
    f = 0.5 - 0.5 * np.cos(2 * np.pi * speed * T)
    out = read(make("force_hysteresis", 0.0, 0.25), f)[:, 0]
    peak = np.maximum.accumulate(f)
    half, full = 0.5 / speed, 1 / speed
    assert out[half > T] == pytest.approx(f[half > T], abs=1e-12)
    falling = (half <= T) & (full > T)
    assert out[falling] == pytest.approx(np.minimum(1.25 * f, peak)[falling], abs=1e-12)


def test_force_gain_asymmetry_keeps_the_common_gain():
    out = read(make("force_gain_asymmetry", 0.1), wave())
    assert out == pytest.approx(np.outer(wave(), [1.1, 0.9]))
    assert out.mean(axis=1) == pytest.approx(wave())


def test_force_lag_is_an_exponential():
    tau, keep = 0.08, np.exp(-DT / 0.08)
    out = read(make("force_lag", tau), np.where(T < 0.1, 0.2, 1.2))[:, 0]
    assert out == pytest.approx(np.where(T < 0.1, 0.2, 1.2 - np.exp(-(T - 0.1 + DT) / tau)), abs=1e-12)
    out = read(make("force_lag", tau), wave())[:, 0]
    assert out == pytest.approx(lfilter([1 - keep], [1, -keep], wave()), abs=1e-12)


@pytest.mark.parametrize("steps", [1, 7.75, 40])
def test_force_delay_shifts_by_exactly_d(steps):
    out = read(make("force_delay", steps * DT), wave(), 2 * wave())
    expected = np.interp(T - steps * DT, T, wave())
    assert out == pytest.approx(np.stack([expected, 2 * expected], axis=1), abs=1e-12)


def test_force_deadzone():
    f = np.linspace(-1, 1, 201)
    subtract, gate = (read(make("force_deadzone", 0.305, variant=v), f)[:, 0] for v in ("subtract", "gate"))
    silent = np.abs(f) < 0.305
    assert np.all(subtract[silent] == 0)
    assert np.all(gate[silent] == 0)
    assert subtract[~silent] == pytest.approx(f[~silent] - 0.305 * np.sign(f[~silent]))
    assert np.array_equal(gate[~silent], f[~silent])


def test_force_drift_has_its_slopes():
    out = read(make("force_drift", 0.02, -0.05), wave(), wave(2.0))
    assert out == pytest.approx(np.stack([wave() + 0.02 * T, wave(2.0) - 0.05 * T], axis=1), abs=1e-12)


def test_force_bias():
    out = read(make("force_bias", 0.06, -0.04), wave(), 0 * T)
    assert out == pytest.approx(np.stack([wave() + 0.06, 0 * T - 0.04], axis=1), abs=1e-12)


def test_force_saturation():
    out = read(make("force_saturation", 0.5), wave())[:, 0]
    assert out.max() == 0.5
    assert out.min() == -0.5
    inside = np.abs(wave()) < 0.5
    assert np.array_equal(out[inside], wave()[inside])


def test_encoder_bias_moves_readings_and_nothing_else():
    plant = settle("encoder_bias", (0.0003, -0.0002), 0.0225)
    base = settle("", (), 0.0225)
    assert plant.measured_position - plant.position == pytest.approx(np.array([[0.0003, -0.0002]]), abs=1e-15)
    assert np.array_equal(plant.position, base.position)
    assert np.array_equal(plant.measured_force, base.measured_force)


@pytest.mark.parametrize("target", [0.030, 0.0225])
def test_encoder_bias_in_the_loop_moves_the_finger(target):
    """The servo brings what it reads to the command, so the finger stands off by the bias."""
    bias = np.array([0.0003, -0.0002])
    plant = settle("encoder_bias", tuple(bias), target, variant="loop")
    assert plant.measured_position - plant.position == pytest.approx(bias[None], abs=1e-15)
    if target > TOUCH_M:
        assert plant.position[0] == pytest.approx(target - bias, abs=1e-6)
    else:
        held = GAIN * (plant.measured_position - target) * FORCE_SCALE
        assert plant.force == pytest.approx(held, rel=0.03)


def test_quantisation_rounds_to_the_nearest_step():
    effect = make("quantisation", 0.001, 0.25)
    force = read(effect, wave())[:, 0]
    assert set(force / 0.25) <= set(range(-10, 11))
    assert np.abs(force - wave()).max() <= 0.125
    position = effect.read_position(np.array([[0.0234, 0.0236]]))
    assert position == pytest.approx(np.array([[0.023, 0.024]]))
    assert np.array_equal(read(make("quantisation", 0.001, 0.0), wave())[:, 0], wave())


def test_readings_do_not_act_back():
    """Effects of the sensor stage leave what happens alone; the others do not touch a reading that they need not."""
    base = rollout(1)
    for effect in catalogue().values():
        trace = rollout(1, [(effect, effect.typical_values(), "", [0])])
        unmoved = np.array_equal(trace.true_position, base.true_position)
        assert unmoved == effect.reads_only() == (effect.stage == "sensor"), effect.name


def test_trace_of_nothing_is_what_is_true():
    plant = make_plant(1)
    start(plant, [0])
    trace = play(plant)
    assert np.array_equal(trace.force, trace.true_force)
    assert np.array_equal(trace.position, trace.true_position)
