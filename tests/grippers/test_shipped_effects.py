"""Every effect on every shipped gripper: nothing at its null value, something at its typical size."""

from __future__ import annotations

import numpy as np
import pytest

from forcegrasp.config import GraspConfig
from forcegrasp.effects.base import Effect
from forcegrasp.effects.for_gripper import effects_of, why_left_out
from forcegrasp.effects.registry import catalogue
from forcegrasp.physics import GraspSampler, Gripper
from forcegrasp.physics.gripper_file import load_gripper, shipped_grippers
from forcegrasp.physics.plant import Plant, write_base
from forcegrasp.physics.sensors import is_rounding, with_noise
from forcegrasp.physics.simulator import base_parameters

#: 25 Hz commands as shares of the stroke, around the contact: close, press, pause, release, creep, close again.
CONTACT = np.repeat([0.3, 0.0, -0.01, -0.04, -0.1, -0.11, 0.06, 0.3], [6, 8, 6, 6, 6, 4, 5, 12])
COMMAND = np.concatenate([CONTACT, np.linspace(0.16, 0.14, 14), np.repeat([0.0, -0.1], 8)])
RELEASED = slice(46, 52)


def cases(gripper: Gripper) -> list[tuple[type[Effect], str]]:
    return [(effect, variant) for effect in effects_of(gripper).values() for variant in effect.variants]


def roll(gripper: Gripper, with_effects: bool) -> np.ndarray:
    """``(samples, rows, readings)``: row 0 has no effect, then each variant its null values and its typical size."""
    effects = cases(gripper) if with_effects else []
    n = 1 + 2 * len(effects)
    plant, ids = Plant(gripper, n, "fast", threads=1), np.arange(n)
    sizes = [np.array([effect.null_values(), effect.typical_values()]) for effect, _ in effects]
    plant.attach(
        [
            (effect(size, plant.dt, variant), np.array([1, 2]) + 2 * i)
            for i, ((effect, variant), size) in enumerate(zip(effects, sizes, strict=True))
        ]
    )
    grasp = GraspSampler(GraspConfig(), gripper)(np.random.default_rng(3), np.arange(1))
    base = {name: np.repeat(value, n) for name, value in base_parameters(gripper, grasp).items()}
    plant.reset(ids, write_base(plant, ids, base))
    touch, seen = gripper.contact_position(grasp.radius_m[0]), []
    for share in COMMAND:
        command = np.clip(touch + share * gripper.stroke, 0, gripper.stroke)
        plant.advance(np.full((n, plant.motors), command), round(gripper.period_s / plant.dt))
        position, force = plant.measured_position.copy(), plant.measured_force.copy()
        for i, (effect, _) in enumerate(effects):
            if is_rounding(effect):  # of readings, after a noise of 0
                for row, steps in enumerate(sizes[i], 1 + 2 * i):
                    position[row], force[row] = (
                        with_noise(v[row], 0.0, 0.0, s) for v, s in zip((position, force), steps, strict=True)
                    )
        seen.append(np.concatenate([position, force], axis=1))
    assert not plant.warnings().any()
    return np.array(seen)


@pytest.fixture(scope="module")
def plain(gripper) -> np.ndarray:
    return roll(gripper, with_effects=False)[:, 0]


@pytest.fixture(scope="module")
def side_by_side(gripper) -> np.ndarray:
    return roll(gripper, with_effects=True)


def test_the_grasp_is_worth_looking_at(gripper, plain):
    force = plain[:, len(gripper.motors) :]
    assert (force.max(axis=0) > 4 * gripper.training.contact_threshold_n).all()
    if gripper.force == "sensors":  # a motor's effort moves the fingers, too
        assert (force[RELEASED] < gripper.training.contact_threshold_n).all(), "not released"


def test_null_values_leave_every_bit(gripper, plain, side_by_side):
    null = side_by_side[:, 1::2]
    changed = [case for i, case in enumerate(cases(gripper)) if not np.array_equal(null[:, i], plain)]
    assert changed == []


def test_neighbours_with_effects_leave_every_bit(plain, side_by_side):
    np.testing.assert_array_equal(side_by_side[:, 0], plain)


def test_typical_sizes_change_what_is_read(gripper, plain, side_by_side):
    assert np.isfinite(side_by_side).all()
    widths = np.ptp(plain, axis=0)
    change = (np.abs(side_by_side[:, 2::2] - plain[:, None]) / widths).max(axis=(0, 2))
    same = [(effect.name, variant) for i, (effect, variant) in enumerate(cases(gripper)) if change[i] < 1e-4]
    assert same == []


def test_a_contact_without_friction_is_left_out_where_pads_turn():
    hunt_crossley = catalogue()["hunt_crossley_contact"]
    for name in shipped_grippers():
        why = why_left_out(hunt_crossley, load_gripper(name))
        turn = "needs pads that stay parallel, or an object on a slide; the pads of so101_gripper turn"
        assert why == (turn if name == "so101_gripper" else "")
