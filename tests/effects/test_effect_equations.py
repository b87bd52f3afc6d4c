"""Effects of transmission, contact and sensors, each against its equation once more: on signals, and in the grasp."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter

from forcegrasp.effects import Effect, catalogue, get_effect
from forcegrasp.effects.base import Contribution
from forcegrasp.effects.touch import pad_reach
from forcegrasp.physics.contact_law import contact_numbers
from forcegrasp.physics.gripper_file import load_gripper
from forcegrasp.physics.ground import let_ground_decide
from forcegrasp.physics.plant import Plant, write_base

from .rollouts import FORCE_SCALE, make_plant, play, rollout, start
from .signals import DT, GAIN, TOUCH_M, T, butterworth, make, read, settle, wave

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


def crossing(tier: str, speed: float, *closed: float) -> tuple[float, np.ndarray]:
    """Force before a motor crosses most of a backlash of 1 mm, and forces while it does, opening so fast."""
    plant = make_plant(1, [(get_effect("backlash"), (0.001,), "play", [0])], tier)
    start(plant, [0], np.zeros(1))
    for target in closed:
        plant.advance(np.full((1, 2), target), round(1.6 / plant.dt))
    before, moved, forces, target = plant.pad_force[0, 0], [plant.position[0, 0]], [], closed[-1]
    while moved[-1] < moved[0] + 0.0008:
        target += speed * plant.dt
        plant.advance(np.full((1, 2), target))
        forces.append(plant.pad_force[0, 0])
        moved.append(plant.position[0, 0])
    assert np.diff(moved).max() > 0.15 * speed * plant.dt
    return before, np.array(forces)


@pytest.mark.parametrize(
    ("tier", "speed", "loses"), [("reference", 0.004, 0.03), ("reference", 0.02, 0.07), ("fast", 0.004, 0.05)]
)
def test_backlash_keeps_the_force_however_fast_the_motor_crosses(tier, speed, loses):
    """MuJoCo would let it fall by half, and to nothing: it damps contacts by the speed of the motor's body."""
    before, forces = crossing(tier, speed, 0.0245, 0.023, 0.022, 0.021)
    np.testing.assert_allclose(forces, before, rtol=loses)


def test_backlash_does_not_press_harder_where_contacts_are_light_and_the_motor_is_fast():
    before, forces = crossing("reference", 0.2, 0.0245, 0.0235)
    assert 0 < before < 0.01
    assert forces.max() < 1.5 * before


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
    # the object slides a little along the pads meanwhile
    assert after.pad_force[0] == pytest.approx(before.pad_force[0], rel=0.09)


@pytest.mark.parametrize("compliance", [0.0005, 0.002])
def test_finger_compliance_deflects_in_proportion_to_force(compliance):
    plant = settle("finger_compliance", (compliance,), 0.0215)
    force = plant.pad_force[0]
    assert plant.pad_shift_m[0] == pytest.approx(compliance * force, rel=1e-3)
    rigid = [settle("", (), target) for target in np.linspace(0.0205, 0.0225, 9)]
    pad = np.interp(force[0], *np.array([(p.pad_force[0, 0], p.position[0, 0]) for p in rigid][::-1]).T)
    assert plant.position[0, 0] + compliance * force[0] == pytest.approx(pad, abs=1e-5)
    assert plant.position[0, 0] < rigid[4].position[0, 0]  # the encoder runs ahead


@pytest.mark.parametrize(("share", "time_constant"), [(0.0, 0.4), (0.6, 0.4), (0.0, 1.5)])
def test_finger_creep_deflects_with_time_and_comes_to_what_a_spring_does(share, time_constant):
    compliance = 0.001
    creeps = make("finger_creep", compliance, share, time_constant)
    squeeze = np.concatenate([np.full(1000, 0.8), np.zeros(1000)])  # 2 s of it, then 2 s of rest
    creeps.attach(SimpleNamespace(press_n=np.zeros((1, 2))), [0])
    shift = []
    for force in squeeze:
        creeps.plant.press_n[:] = force
        shift.append(creeps.act().pad_shift_m[0, 0])
    t = np.arange(1, 1001) * creeps.dt
    slow = 1 - np.exp(-t / time_constant)
    settled = t > 0.1  # what comes at once has settled by then
    expected = compliance * 0.8 * (share + (1 - share) * slow)
    assert np.array(shift)[:1000][settled] == pytest.approx(expected[settled], rel=1e-3)
    after = compliance * 0.8 * (1 - share) * slow[-1] * (1 - slow)
    assert np.array(shift)[1000:][settled] == pytest.approx(after[settled], abs=1e-8)
    # in the plant, held for long enough, it is the spring to the last digits that matter
    plant, spring = (
        settle(name, values, 0.0215, seconds=8 * time_constant)
        for name, values in (("finger_creep", creeps.values[0]), ("finger_compliance", (compliance,)))
    )
    assert plant.pad_force[0] == pytest.approx(spring.pad_force[0], rel=3e-3)


class Pads:
    """Stands for a plant with both pads at given places along the grasp axis, and motors of any strength."""

    pad_shift_m = np.zeros((1, 2))
    object_geoms = np.array([0])
    width_m = 0.004  # of the object's contact
    factors = (1.0, 1.0)  # damping and stiffness of the object's contact ÷ the scene's

    def __init__(self, distance: np.ndarray, force: np.ndarray | float, centre: float = 0.0) -> None:
        pads = np.array([-1, 1]) * distance + centre  # the left one stands on the negative side
        self.pad_position, self.object_position = (pads * [-1, 1])[None], np.array([centre])
        self.pad_force = np.broadcast_to(np.asarray(force, float), (1, 2))

    def strongest_press(self, rows: np.ndarray) -> np.ndarray:
        return np.full((len(rows), 2), np.inf)

    def clearance(self, rows: np.ndarray) -> np.ndarray:
        return np.zeros((len(rows), 2))

    def mass_between(self, rows: np.ndarray) -> np.ndarray:
        return np.full((len(rows), 2), np.inf)

    def contact_factors(self, rows: np.ndarray) -> np.ndarray:
        return np.tile(self.factors, (len(rows), 1))

    def field(self, name: str) -> np.ndarray:
        return {"geom_solimp": np.array([[[0.0, 0.99, self.width_m, 0.5, 2.0]]])}[name]


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


def test_following_viscoelastic_contact_holds_nothing_back():
    """Its force only falls by the dashpot while the pad is pressed in, and by the spring, too, while it is relieved."""
    distance, force, depth = depth_of((1.0, 0.4))
    added = press(make("viscoelastic_contact", 100.0, 0.2, variant="following"), distance, force, 0 * T)
    expected, keep = np.zeros_like(added), np.exp(-DT / 0.2)
    pressed = np.maximum(depth, 0)
    for now in range(1, len(T)):
        further = pressed[now] - pressed[now - 1]
        expected[now] = np.maximum(keep * (expected[now - 1] + 100.0 * further), 0.0)
    assert (expected[depth > 0] == 0).any()
    assert added == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(("variant", "firm"), [("solid", 1.0), ("solid_by_object", 2.5)])
def test_a_viscoelastic_solid_holds_back_what_is_relieved(variant, firm, monkeypatch):
    """As a whole it only pushes; the branch goes with the stiffness of the object's contact, if it is said to."""
    distance, force, depth = depth_of((1.0, 0.4))
    monkeypatch.setattr(Pads, "factors", (5.0, 2.5))
    added = press(make("viscoelastic_contact", 100.0, 0.2, variant=variant), distance, force, 0 * T)
    keep, pressed = np.exp(-DT / 0.2), np.maximum(depth, 0)
    branch = firm * 100.0 * (pressed - lfilter([1 - keep], [1, -keep], pressed, axis=0))
    for somewhere in (branch > 0.02, (branch < 0) & (branch > -force), branch < -force):
        assert somewhere.any()
    assert added == pytest.approx(np.maximum(branch, -force), abs=1e-9)


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


def test_stiffening_contact_changes_the_power_of_the_impedance():
    """At rest F ∝ r d² / (1 − d) with d = d_max y, y = (2r/ρ)^p / 2 below the middle; so the ratio is known."""
    rho, power = 0.0065, 2 + 1.5

    def rest(values: tuple[float, ...]) -> np.ndarray:
        plants = [settle("stiffening_contact", values, target) for target in (0.0226, 0.0222, 0.0218)]
        return np.array([(TOUCH_M - p.position[0, 0], p.pad_force[0, 0]) for p in plants]).T

    def shape(r: np.ndarray, p: float) -> np.ndarray:
        d = 0.99 * 0.5 * (2 * r / rho) ** p
        return r * d**2 / (1 - d)

    for values, p in (((0.0, 0.0, 3.0), 2.0), ((1.5, 0.0, 3.0), power), ((-1.0, 0.0, 3.0), 1.0)):
        squeeze, force = rest(values)
        assert np.all((squeeze > 0) & (squeeze < rho / 2))
        ratio = force / shape(squeeze, p)
        assert ratio == pytest.approx(ratio[0], rel=0.03)


@pytest.mark.parametrize("power", [1.0, 1.5, 3.0])
def test_stiffening_spring_is_a_power_of_the_depth(power):
    distance, force, depth = depth_of((1.0, 0.4))
    added = press(make("stiffening_contact", 1.5, 0.05, power), distance, force, 0.002 * np.cos(3 * T))
    assert added == pytest.approx(0.05 * np.maximum(depth / 1e-3, 0) ** power, abs=1e-9)


@pytest.mark.parametrize(("force", "power"), [(0.02, 3.0), (0.1, 3.0), (0.1, 1.5)])
def test_stiffening_spring_shares_the_load(force, power):
    """At rest the servo holds the contact and the spring, which are compressed alike."""
    plant = settle("stiffening_contact", (0.0, force, power), 0.0249, 0.0247, 0.0245, 0.023, 0.0215)
    spring = plant.force / FORCE_SCALE - plant.pad_force
    assert spring == pytest.approx(force * ((TOUCH_M - plant.position) / 1e-3) ** power, rel=0.08)
    assert plant.force == pytest.approx(GAIN * (plant.position - 0.0215) * FORCE_SCALE, rel=0.03)
    assert np.all(spring > 0.1 * plant.pad_force)


def test_stiffening_spring_throws_no_finger_out():
    """As hard as it may be, on a small object that turns away from the pads, with 8 ms steps."""
    plant = make_plant(1, [(get_effect("stiffening_contact"), (1.033, 4.623, 3.0), "", [0])], "fast")
    base = {"position_gain": 105.5, "velocity_gain": -26.45, "rho_m": 0.01612, "radius_m": 0.008184}
    values = {name: np.array([value]) for name, value in (base | {"force_scale": 16.62, "offset_m": 0.02111}).items()}
    plant.reset(np.arange(1), write_base(plant, np.arange(1), values))
    for _ in range(150):
        plant.advance(np.maximum(plant.measured_position - 0.003, 0.0), round(0.04 / plant.dt))
    assert not plant.warnings().any()
    assert (plant.position < 0.05).all()


def test_hunt_crossley_contact_is_a_power_of_the_depth_that_approaching_raises():
    distance, force, depth = depth_of((1.0, 0.4))
    added = press(make("hunt_crossley_contact", 0.7, 1.5, 90.0), distance, force)
    before = np.concatenate([distance[:1], distance[:-1]])
    rate = (before - distance) / DT
    assert ((90 * rate < -1) & (depth > 0)).any()  # let go of faster than it follows, it does not pull
    expected = 0.7 * (np.maximum(depth, 0) / Pads.width_m) ** 1.5 * np.maximum(1 + 90 * rate, 0)
    assert added == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(("force", "power"), [(1.0, 1.5), (3.0, 2.5)])
def test_hunt_crossley_contact_takes_the_place_of_the_scenes(force, power):
    """At rest the servo holds it, and nothing else presses."""
    plant = settle("hunt_crossley_contact", (force, power, 5.0), 0.0215)
    depth, width = TOUCH_M - plant.position, plant.field("geom_solimp")[0, plant.object_geoms[0], 2]
    assert plant.press_n == pytest.approx(force * (depth / width) ** power, rel=2e-3)
    assert plant.press_n == pytest.approx(GAIN * (plant.position - 0.0215), rel=2e-3)
    assert (plant.pad_force < 1e-3 * plant.press_n).all()


def test_hunt_crossley_contact_is_as_much_stiffer_and_more_damped_as_an_object_is():
    """By whatever the gripper's parameters write: the width of its solimp, or its solref."""
    plant = make_plant(2, [], "reference")
    geom = plant.object_geoms[0]
    plant.field("geom_solref")[:, geom] = plant.model.geom_solref[geom]
    plant.field("geom_solref")[1, geom] /= (2.0, 1.5)  # b doubled, k = 1 / (τ ζ)² nine times
    effect = get_effect("hunt_crossley_contact")(np.array([[1.0, 1.5, 5.0]] * 2), plant.dt).attach(plant, np.arange(2))
    memory = effect.init(np.arange(2))
    np.testing.assert_allclose(memory["damped"], [[1.0], [2.0]])
    np.testing.assert_allclose(memory["firm"], [[1.0], [9.0]])
    effect.state.update(memory, surface=pad_reach(effect) + 1e-3)
    for rate in (0.0, 0.05):
        effect.state["reach"] = pad_reach(effect) + rate * plant.dt
        effect.act()
        soft, hard = effect.state["push"][:, 0]
        assert hard / soft == pytest.approx(9 * (1 + 10 * rate) / (1 + 5 * rate), rel=1e-6)


@pytest.mark.parametrize(
    ("values", "target"), [((1.0, 1.5, 100.0), 0.01), ((100.0, 1.0, 0.0), 0.0215), ((300.0, 2.0, 30.0), 0.0215)]
)
def test_long_steps_end_where_short_ones_do_however_stiff_the_contact(values, target):
    """Steps of 8 ms would throw pads off a contact whose force is that of a step's beginning."""
    plant = make_plant(1, [(get_effect("hunt_crossley_contact"), values, "", [0])], "fast")
    start(plant, [0], np.zeros(1))
    plant.advance(np.full((1, 2), target), round(1.6 / plant.dt))
    short = settle("hunt_crossley_contact", values, target)
    assert plant.position == pytest.approx(short.position, abs=2e-6)
    assert plant.press_n == pytest.approx(short.press_n, rel=2e-3)


def test_what_effects_in_the_contact_press_bends_fingers_and_loads_gears():
    stiff = [(get_effect("stiffening_contact"), (0.0, 0.3, 3.0), "", [0])]
    for name, values in (("finger_compliance", (0.001,)), ("load_friction", (0.3,))):
        plant = make_plant(1, [*stiff, (get_effect(name), values, "", [0])], "reference")
        start(plant, [0], np.zeros(1))
        plant.advance(np.full((1, 2), 0.0215), 800)
        assert (plant.press_n > 1.2 * plant.pad_force).all()
        assert plant.outside_force == pytest.approx(plant.press_n)
        if name == "finger_compliance":
            assert plant.pad_shift_m == pytest.approx(0.001 * plant.press_n, rel=1e-3)


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


@pytest.mark.parametrize("error_m", [0.001, -0.0005])
def test_object_size_is_that_of_an_object_of_this_radius(error_m):
    """The same readings, to the last bit, as with the radius that the set ought to have given."""

    def squeezed(radius_m: float, error_m: float) -> np.ndarray:
        plant = make_plant(1, [(get_effect("object_size"), [error_m], "", [0])], "reference")
        plant.reset(np.arange(1), write_base(plant, np.arange(1), {"radius_m": np.array([radius_m])}))
        plant.advance(np.full((1, 2), 0.023), 1000)
        return np.concatenate([plant.measured_force, plant.measured_position])

    assert np.array_equal(squeezed(0.024, error_m), squeezed(0.024 + error_m, 0.0))
    assert not np.array_equal(squeezed(0.024, error_m), squeezed(0.024, 0.0))


def test_swapped_forces_stand_in_each_others_column():
    left, right = wave(), wave(2.1)
    swapped = read(make("swapped_forces", 1.0), left, right)
    assert swapped == pytest.approx(np.stack([right, left], axis=1), abs=1e-12)
    half = read(make("swapped_forces", 0.5), left, right)
    assert half == pytest.approx(np.repeat((left + right)[:, None] / 2, 2, axis=1), abs=1e-12)


def test_contact_friction_multiplies_that_of_the_scene():
    factors = np.array([0.5, 1.0, 2.0, 4.0])
    plant = make_plant(4, [(get_effect("contact_friction"), factors[:, None], "", [0, 1, 2, 3])], "reference")
    start(plant, [0, 1, 2, 3], np.full(4, 0.002))  # towards the right finger, which touches first
    mu = plant.field("geom_friction")[..., 0]
    np.testing.assert_allclose(mu, np.outer(factors, mu[1]))
    np.testing.assert_array_equal(plant.field("geom_friction")[..., 1:], plant.field("geom_friction")[[1] * 4, :, 1:])
    plant.advance(np.full((4, 2), 0.0255), 500)
    ways = 0.002 - plant.object_position
    assert np.all(np.diff(ways) < -1e-5)


@pytest.mark.parametrize("tier", ["reference", "fast"])
def test_table_friction_is_felt_by_the_ground_alone(tier):
    """The less it rubs, the further a finger pushes; fingers that hold an object in their middle press as before."""
    factors = np.array([0.5, 1.0, 2.0, 4.0])
    held, pushed = np.arange(4), np.arange(4, 8)
    plant = make_plant(8, [(get_effect("table_friction"), np.tile(factors, 2)[:, None], "", range(8))], tier)
    start(plant, range(8), np.repeat([0.0, 0.002], 4))
    plant.advance(np.repeat([0.02, 0.0255], 4)[:, None] * [1, 1], 500)
    assert np.all(np.diff(0.002 - plant.object_position[pushed]) < -5e-5)
    pressed = plant.pad_force[held].sum(axis=1)
    np.testing.assert_allclose(pressed, pressed[1], rtol=0.02)
    assert pressed[1] > 0.1


@pytest.mark.parametrize("tier", ["reference", "fast"])
def test_object_pull_is_held_by_the_fingers(tier):
    """At rest f_l − f_r + F_0 = 0, but for what the table holds; however hard they press."""
    pull = np.array([0.1, -0.1, 0.1, -0.1])
    plant = make_plant(4, [(get_effect("object_pull"), pull[:, None], "", range(4))], tier)
    start(plant, range(4), np.zeros(4))
    plant.advance(np.repeat([0.021, 0.018], 2)[:, None] * [1, 1], 2000)
    assert np.all(plant.pad_force > 0.1)
    between = plant.pad_force[:, 0] - plant.pad_force[:, 1]
    by_pull = (between[0::2] - between[1::2]) / 2
    assert by_pull == pytest.approx([-0.1, -0.1], rel=0.1)
    assert np.all(np.sign(plant.object_position) == np.sign(pull))


@pytest.mark.parametrize("priorities", [(0, 1), (1, 1), (2, 1)])
@pytest.mark.parametrize("solref", [(0.02, 1.0), (-2500.0, -100.0)])
def test_a_ground_that_decides_changes_nothing_by_itself(priorities, solref):
    plant = make_plant(2, [], "reference")
    (ground,), own = plant.ground_geoms, plant.object_geoms[0]
    plant.model.geom_priority[[ground, own]] = priorities
    plant.model.geom_friction[ground, 0], plant.model.geom_solref[own] = 1.3, solref
    start(plant, [0, 1], np.full(2, 0.002))
    for name in ("geom_priority", "geom_friction", "geom_solref"):
        plant.field(name)[:] = getattr(plant.model, name)
    let_ground_decide(plant, ground, np.array([0]))
    assert plant.field("geom_priority")[0, ground] > priorities[1]
    plant.advance(np.full((2, 2), 0.0255), 300)
    np.testing.assert_allclose(plant.object_position[0], plant.object_position[1], rtol=1e-12)


@pytest.mark.parametrize("tier", ["reference", "fast"])
@pytest.mark.parametrize("solref", [(0.02, 1.0), (-2500.0, -100.0)])
def test_contact_damping_multiplies_damping_and_stiffness_of_the_scenes_contacts(tier, solref):
    """Where steps are too long for so short a time constant the stiffness is right all the same."""
    factors = np.array([[1.0, 1.0], [0.4, 1.0], [0.5, 3.0], [2.5, 0.2]])
    effect = get_effect("contact_damping")
    plant = make_plant(4, [], tier)
    plant.field("geom_solref")[:] = solref
    effect(factors, plant.dt).attach(plant, np.arange(4)).change_model(plant, np.arange(4))
    geom = plant.object_geoms[0]
    numbers = contact_numbers(plant.field("geom_solref")[:, geom], plant.field("geom_solimp")[:, geom])
    np.testing.assert_allclose(numbers[:, 1], factors[:, 1] * numbers[0, 1], rtol=1e-12)
    most = 1 / plant.dt / 0.99 if solref[0] > 0 else np.inf  # 2 / b is two steps
    np.testing.assert_allclose(numbers[:, 0], np.minimum(factors[:, 0] * numbers[0, 0], most), rtol=1e-6)


def squeezed(name: str, values: np.ndarray) -> tuple[Plant, list[np.ndarray]]:
    """What is left of a fast squeeze of 2 s with an effect, a row of values each, and the left forces ``(rows,)``."""
    rows, forces = list(range(len(values))), []
    plant = make_plant(len(values), [(get_effect(name), values, "", rows)], "reference")
    start(plant, rows, np.zeros(len(values)))
    for _ in range(1000):
        plant.advance(np.full((len(values), 2), 0.021))
        forces.append(plant.pad_force[:, 0])
    return plant, forces


def test_the_less_a_touch_is_damped_the_later_its_force_grows_and_the_further_beyond_where_it_settles():
    _, forces = squeezed("contact_damping", np.array([[0.4, 1.0], [1.0, 1.0], [2.0, 1.0]]))
    assert np.all(np.diff(forces[40]) > 0.05)  # some 30 ms after the touch
    assert max(force[0] for force in forces) > 1.5 * max(force[1] for force in forces)
    np.testing.assert_allclose(forces[-1], forces[-1][1], rtol=0.02)


def test_contact_onset_moves_the_impedance_that_contacts_begin_with():
    shares = np.array([-1.0, -0.5, 0.0, 0.5, 1.0])
    effect = get_effect("contact_onset")
    plant = make_plant(5, [], "reference")
    plant.field("geom_solimp")[:, :, :2] = 0.2, 0.9
    effect(shares[:, None], plant.dt).attach(plant, np.arange(5)).change_model(plant, np.arange(5))
    solimp = plant.field("geom_solimp")
    np.testing.assert_allclose(solimp[:, plant.object_geoms[0], 0], [0.0, 0.1, 0.2, 0.55, 0.9], rtol=1e-12)
    assert (solimp[..., 1] == 0.9).all()
    others = np.delete(np.arange(solimp.shape[1]), plant.object_geoms)
    assert (solimp[:, others, 0] == 0.2).all()


def test_a_contact_that_begins_with_more_impedance_presses_sooner():
    plant, forces = squeezed("contact_onset", np.array([[0.0], [0.1], [0.4]]))
    assert np.all(np.diff(forces[32]) > 0.1)  # within 2 ms of the touch
    assert np.all(np.diff(plant.position[:, 0]) > 1e-4)  # and holds at less depth


def test_object_mass_multiplies_that_of_the_scene():
    factors = np.array([0.25, 1.0, 4.0])
    plant = make_plant(3, [(get_effect("object_mass"), factors[:, None], "", [0, 1, 2])], "reference")
    start(plant, [0, 1, 2], np.full(3, 0.002))  # towards the right finger, which touches first
    body = plant.model.geom_bodyid[plant.object_geoms[0]]
    np.testing.assert_allclose(plant.field("body_mass")[:, body], factors * plant.model.body_mass[body])
    np.testing.assert_allclose(plant.field("body_inertia")[:, body], np.outer(factors, plant.model.body_inertia[body]))
    plant.advance(np.full((3, 2), 0.0255), 500)
    ways = 0.002 - plant.object_position
    assert np.all(np.diff(ways) < -1e-5)


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


@pytest.mark.parametrize("tier", ["reference", "fitting", "fast"])
def test_smooth_object_friction_creeps_in_proportion_to_the_push_and_then_slides(tier):
    class Push(Effect):
        name, stage, parameters = "push", "object", ()
        newtons = np.zeros(0)

        def act(self) -> Contribution:
            return Contribution(object_push_n=self.newtons)

    slide, speed = 0.1, 2e-3
    push = Push(np.empty((5, 0)), 0.002)
    push.newtons = np.array([0.03, 0.03, 0.06, 0.06, 0.3])  # the first and third without the effect
    gripper = load_gripper("tiago")
    plant, rows = Plant(gripper, 5, tier=tier, threads=1), np.array([1, 3, 4])
    creeps = get_effect("smooth_object_friction")(np.array([[slide, speed]] * 3), plant.dt)
    plant.attach([(creeps, rows), (push, np.arange(5))])
    plant.reset(np.arange(5), np.zeros(5))
    plant.advance(np.full((5, 2), gripper.stroke), round(1 / plant.dt))
    before = plant.object_position.copy()
    plant.advance(np.full((5, 2), gripper.stroke), round(0.2 / plant.dt))
    free, creeping, twice_free, twice, beyond = (plant.object_position - before) / 0.2
    # the scene's own creep takes its part of the push: dampers side by side
    assert creeping == pytest.approx(0.03 / (0.03 / free + slide / speed), rel=0.01)
    assert twice == pytest.approx(0.06 / (0.06 / twice_free + slide / speed), rel=0.01)
    # beyond the speed at which it slides friction grows no more
    assert beyond > speed
    assert beyond * 0.03 / free == pytest.approx(0.3 - slide, rel=0.03)


# --- sensors -------------------------------------------------------------------------------------------------------


def test_force_crosstalk():
    out = read(make("force_crosstalk", 0.1, 0.0), wave(), 0 * T)
    assert out == pytest.approx(np.stack([wave(), 0.1 * wave()], axis=1))
    out = read(make("force_crosstalk", -0.2, 0.0), wave(), wave(2.0))
    assert out == pytest.approx(np.stack([wave() - 0.2 * wave(2.0), wave(2.0) - 0.2 * wave()], axis=1))


def test_force_crosstalk_may_be_uneven():
    """The left reading has 6 % of the right force, the right one 2 % of the left force."""
    out = read(make("force_crosstalk", 0.04, 0.02), wave(), wave(2.0))
    assert out == pytest.approx(np.stack([wave() + 0.06 * wave(2.0), wave(2.0) + 0.02 * wave()], axis=1))


def test_force_hysteresis_width():
    """A closed loop of more than the width is a parallelogram: w/2 less while rising, w/2 more while falling."""
    f = 0.5 - 0.5 * np.cos(2 * np.pi * 2 * T)
    out = read(make("force_hysteresis", 0.1, 0.0), f)[:, 0]
    second = T >= 0.5
    rising = np.gradient(f) > 0
    plateau = (f < 0.1) | (f > 0.9)
    assert out[second & rising & ~plateau] == pytest.approx(f[second & rising & ~plateau] - 0.05, abs=1e-12)
    assert out[second & ~rising & ~plateau] == pytest.approx(f[second & ~rising & ~plateau] + 0.05, abs=1e-12)


@pytest.mark.parametrize(("variant", "released"), [("lasting", 0.05), ("zeroed", 0.0)])
def test_force_hysteresis_once_released(variant, released):
    """Half the width stays, or nothing; what was read of a light touch before is read of it again."""
    f = np.concatenate([np.linspace(0, 1, 50), np.linspace(1, 0, 50), np.zeros(50), np.full(50, 0.02)])
    out = read(make("force_hysteresis", 0.1, 0.0, variant=variant), f)[:, 0]
    assert out[110:150] == pytest.approx(released, abs=1e-12)
    assert out[150:] == pytest.approx(0.05, abs=1e-12)


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


@pytest.mark.parametrize("excess", [-0.1, 0.05])
def test_rounded_force_hysteresis_turns_as_dahl_says(excess):
    """From the virgin curve: s = 1 − exp(−f / r); after a turn at f₁: s = −1 + (1 + s₁) exp(−(f₁ − f) / r)."""
    reach = 0.2
    f = np.concatenate([np.linspace(0, 1, 101), np.linspace(1, 0.4, 61)[1:], np.full(20, 0.4)])
    out = read(make("rounded_force_hysteresis", excess, reach), f)[:, 0]
    loading = f + excess * (1 - np.exp(-f / reach))
    turned = f + excess * ((2 - np.exp(-1 / reach)) * np.exp(-(1 - f) / reach) - 1)
    np.testing.assert_allclose(out, np.where(np.arange(len(f)) <= 100, loading, turned), atol=1e-12)


@pytest.mark.parametrize(("variant", "released"), [("lasting", 0.1), ("zeroed", 0.0)])
def test_rounded_force_hysteresis_once_released(variant, released):
    f = np.concatenate([np.linspace(0, 1, 50), np.linspace(1, 0, 50), np.zeros(5)])
    out = read(make("rounded_force_hysteresis", -0.1, 0.05, variant=variant), f)[:, 0]
    assert out[-5:] == pytest.approx(released, abs=1e-6)


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


@pytest.mark.parametrize("tau", [0.003, 0.02, 0.08])
def test_a_force_filter_may_be_a_butterworth_of_second_order(tau):
    """SciPy's filter with the same corner, of a force that stays for a step."""
    force = wave()
    out = read(make("force_lag", tau, variant="butterworth"), force)[:, 0]
    assert out == pytest.approx(butterworth(force, tau), abs=1e-9)
    assert read(make("force_lag", 0.0, variant="butterworth"), force)[:, 0] == pytest.approx(force, abs=1e-12)


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


@pytest.mark.parametrize("knee", [0.002, 0.4, 1.0])
def test_force_saturation_bends(knee):
    force = wave()
    assert np.abs(force).max() > 0.6
    out = read(make("force_saturation", 0.5, knee), force)[:, 0]
    if knee < 0.01:  # as good as sharp, and no number is too large
        assert out == pytest.approx(np.clip(force, -0.5, 0.5), abs=1e-3)
    else:
        assert out == pytest.approx(force / (1 + np.abs(force / 0.5) ** (1 / knee)) ** knee, rel=1e-9, abs=1e-12)


def test_force_saturation():
    out = read(make("force_saturation", 0.5, 0.0), wave())[:, 0]
    assert out.max() == 0.5
    assert out.min() == -0.5
    inside = np.abs(wave()) < 0.5
    assert np.array_equal(out[inside], wave()[inside])


@pytest.mark.parametrize("steps", [1, 7.75, 40])
def test_readout_skew_shifts_by_exactly_d(steps):
    effect = make("readout_skew", steps * DT)
    read_late = np.array([effect.read_position(np.full((1, 2), q))[0, 0] for q in wave()])
    assert read_late == pytest.approx(np.interp(T - steps * DT, T, wave()), abs=1e-12)


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


def test_encoder_scale_moves_readings_in_proportion():
    plant, base = settle("encoder_scale", (0.02, -0.01), 0.0225), settle("", (), 0.0225)
    assert np.array_equal(plant.position, base.position)
    assert plant.measured_position[0] == pytest.approx(base.position[0] * [1.02, 0.99], rel=1e-12)


@pytest.mark.parametrize("target", [0.030, 0.042])
def test_encoder_scale_in_the_loop_moves_the_finger(target):
    """The servo brings what it reads to the command."""
    plant = settle("encoder_scale", (0.02, -0.01), target, variant="loop")
    assert plant.measured_position[0] == pytest.approx([target] * 2, abs=2e-6)
    assert plant.position[0] == pytest.approx(target / np.array([1.02, 0.99]), abs=2e-6)


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
