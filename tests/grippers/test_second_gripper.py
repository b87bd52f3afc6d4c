"""Every effect on a gripper that is not TIAGo's: along x, joints that grow while closing, other masses and forces."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from forcegrasp.effects.base import Contribution, Effect
from forcegrasp.effects.for_gripper import why_left_out
from forcegrasp.effects.registry import catalogue
from forcegrasp.physics.gripper_file import load_gripper
from forcegrasp.physics.plant import Plant, write_base
from forcegrasp.physics.sensors import is_rounding, with_noise

SECOND = Path(__file__).with_name("second.yaml")
VARIANTS = [(name, variant) for name, effect in catalogue().items() for variant in effect.variants]
#: Typical sizes are TIAGo's; this gripper presses that many times as hard.
FORCES_ARE = 5
#: 25 Hz commands that close off-centre, press harder, pause, reverse, release, creep in free air and close again.
COMMAND = np.concatenate(
    [
        np.repeat([(0.03, 0.03), (0.012, 0.012), (0.006, 0.004), (0.0052, 0.0042)], [5, 12, 8, 4], axis=0),
        np.repeat([(0.013, 0.012), (0.03, 0.03)], [5, 12], axis=0),
        np.linspace(0.03, 0.029, 8)[:, None].repeat(2, axis=1),
        np.repeat([(0.012, 0.014)], 6, axis=0),
    ]
)
PRESSED, RELEASED = slice(19, 25), slice(40, 46)
#: What base parameters of a row may be; friction and stiffness not the scene's own, lest an effect falls back on those.
BASE = {"joint_friction": 0.02, "contact_stiffness": 1200.0, "radius_m": 0.022, "offset_m": 0.004}


Row = tuple[type[Effect], str, np.ndarray, np.ndarray]  #: class, variant, rows, values


def _roll(n: int, effects: Sequence[Row] = (), again: int = 0) -> np.ndarray:
    """Replays the command, then so many samples of it again on the same plant; readings and truth, ``(…, n, 7)``."""
    plant, ids = Plant(load_gripper(str(SECOND)), n, threads=1), np.arange(n)
    plant.attach([(effect(values, plant.dt, variant), rows) for effect, variant, rows, values in effects])
    seen = []
    for commands in (COMMAND, COMMAND[:again]):
        offset = write_base(plant, ids, {name: np.full(n, value) for name, value in BASE.items()})
        plant.reset(ids, offset, np.full((n, 2), 0.05))
        for command in commands:
            plant.advance(np.tile(command, (n, 1)), 40)
            truth = (plant.position, plant.object_position[:, None])
            force, position = plant.measured_force.copy(), plant.measured_position.copy()
            for effect, _, rows, values in effects:
                if is_rounding(effect):  # of readings, after a noise of 0
                    for row, steps in zip(rows, values, strict=True):
                        position[row], force[row] = (
                            with_noise(v[row], 0.0, 0.0, s) for v, s in zip((position, force), steps, strict=True)
                        )
            seen.append(np.concatenate([force, position, *truth], axis=1))
    assert not plant.warnings().any()
    return np.array(seen)


def _typical(effect: type[Effect]) -> np.ndarray:
    factors = [FORCES_ARE if p.unit == "N" else 1 / FORCES_ARE if p.unit == "m/N" else 1 for p in effect.parameters]
    values = effect.typical_values() * factors
    return np.clip(values, [p.low for p in effect.parameters], [p.high for p in effect.parameters])


@pytest.fixture(scope="module")
def plain() -> np.ndarray:
    return _roll(1)[:, 0]


@pytest.fixture(scope="module")
def side_by_side() -> np.ndarray:
    """Row 0 has no effect; then each variant in its typical size; then each at its null values, in the same order.

    And what follows the whole command is the start of it again, until it presses.
    """
    effects, n = [(catalogue()[name], variant) for name, variant in VARIANTS], len(VARIANTS)
    sizes = [np.stack([_typical(effect), effect.null_values()]) for effect, _ in effects]
    rows = [np.array([row, row + n]) for row in range(1, n + 1)]
    return _roll(
        1 + 2 * n, [(*one, at, values) for one, at, values in zip(effects, rows, sizes, strict=True)], again=24
    )


@pytest.fixture(scope="module")
def typical(side_by_side) -> np.ndarray:
    return side_by_side[: len(COMMAND), 1 : 1 + len(VARIANTS)]


def test_the_grasp_is_worth_looking_at(plain):
    force, position = plain[:, :2], plain[:, 4:6]
    assert (force.max(axis=0) > 3).all()
    assert (force[RELEASED] == 0).all()
    assert position.min() > 0.015
    assert abs(plain[-1, 6]) < 0.004  # the object was pushed towards the middle


def test_null_values_leave_every_bit(plain, side_by_side):
    null = side_by_side[: len(COMMAND), 1 + len(VARIANTS) :]
    different = [VARIANTS[i] for i in range(len(VARIANTS)) if not np.array_equal(null[:, i], plain)]
    assert different == []


@pytest.mark.parametrize("name", ["coulomb_friction", "finger_compliance", "object_friction", "stiffening_contact"])
def test_null_values_leave_every_bit_alone(plain, name):
    """Without neighbours, whose fields it might have borrowed."""
    effect = catalogue()[name]
    seen = _roll(1, [(effect, "", np.arange(1), effect.null_values()[None])])
    np.testing.assert_array_equal(seen[:, 0], plain)


def test_neighbours_with_effects_leave_every_bit(plain, side_by_side):
    np.testing.assert_array_equal(side_by_side[: len(COMMAND), 0], plain)


@pytest.mark.parametrize(("name", "variant"), VARIANTS)
def test_typical_size_changes_what_it_should(plain, typical, name, variant):
    seen = typical[:, VARIANTS.index((name, variant))]
    assert np.isfinite(seen).all()
    change = np.abs(seen - plain).max(axis=0)
    slides_on_a_rail = name in ("contact_friction", "table_friction")  # pads press it, and nothing rubs along it
    assert (change[:4].max() > 1e-4) != slides_on_a_rail, "nothing to be read of it"
    if catalogue()[name].reads_only(variant):
        assert (change[4:] == 0).all(), "a sensor moved something"


def test_friction_of_a_table_is_left_out_where_there_is_none():
    assert why_left_out(catalogue()["table_friction"], load_gripper(str(SECOND))).startswith("needs ground")


def test_what_ran_before_leaves_no_trace(side_by_side):
    again = side_by_side[len(COMMAND) :]
    np.testing.assert_array_equal(again, side_by_side[: len(again)])


class Shift(Effect):
    """Moves both pads by so much towards opening."""

    name, stage, parameters = "shift", "transmission", ()
    shift_m = 0.0

    def act(self) -> Contribution:
        return Contribution(pad_shift_m=np.array(self.shift_m))


def _touch_at(gripper, shift_m: float, radius: float) -> np.ndarray:
    """Finger positions at which the fingers first press, closing slowly, ``(2,)``."""
    plant = Plant(gripper, 1, threads=1)
    effect = Shift(np.empty((1, 0)), plant.dt)
    effect.shift_m = shift_m
    plant.attach([(effect, np.arange(1))])
    start = np.full((1, 2), radius - shift_m + 0.001)
    for _ in range(2):  # the first time leaves shifted pads behind
        plant.reset(np.arange(1), np.zeros(1), start)
        found = np.full(2, np.nan)
        for step in range(400):
            plant.advance(start - 5e-6 * step, 4)
            found = np.where(np.isnan(found) & (plant.pad_force[0] > 0), plant.position[0], found)
    return found


@pytest.mark.parametrize("name", ["tiago", str(SECOND)])
@pytest.mark.parametrize("shift_m", [0.003, 0.0, -0.003])
def test_pad_that_stands_further_out_touches_further_in(name, shift_m):
    gripper = load_gripper(name)
    radius = gripper.parameters["radius_m"].nominal
    assert _touch_at(gripper, shift_m, radius) == pytest.approx([radius - shift_m] * 2, abs=5e-5)


def test_pads_on_bodies_of_their_own_shift_too(tmp_path):
    scene = SECOND.with_suffix(".xml").read_text()
    for side in ("west", "east"):
        pads = f'<geom name="{side}"/>\n      <site name="{side}"/>'
        assert pads in scene
        turned = pads.replace("/>", ' euler="0 0 -90"/>')
        inertia = '<inertial pos="0 0 0" mass="0.1" diaginertia="1e-4 1e-4 1e-4"/>'
        scene = scene.replace(pads, f'{inertia}<body euler="0 0 90">{turned}</body>')
    (tmp_path / "second.xml").write_text(scene)
    (tmp_path / "second.yaml").write_text(SECOND.read_text())
    gripper = load_gripper(str(tmp_path / "second.yaml"))
    assert _touch_at(gripper, 0.003, 0.02) == pytest.approx([0.017] * 2, abs=5e-5)


def test_compliance_lets_force_fall_and_fingers_close_further(plain):
    """Were the pads to move inward, as a wrong sign would have them, the force would grow."""
    compliance = catalogue()["finger_compliance"]
    seen = _roll(2, [(compliance, "", np.arange(2), np.array([[0.0], [5e-4]]))])
    np.testing.assert_array_equal(seen[:, 0], plain)
    stiff, soft = seen[PRESSED, 0], seen[PRESSED, 1]
    assert (soft[:, :2] < stiff[:, :2] - 0.1).all()
    travel = stiff[-1, 4:6] - soft[-1, 4:6]
    assert travel == pytest.approx(5e-4 * soft[-1, :2], abs=3e-4)
