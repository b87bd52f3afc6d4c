"""Every effect on every shipped gripper: nothing at its null value, something at its typical size."""

from __future__ import annotations

from collections.abc import Callable

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


def roll(gripper: Gripper, size: Callable[[type[Effect]], np.ndarray] | None) -> np.ndarray:
    """Row 0 without effects, and a row for each effect and variant; ``(samples, rows, readings)``."""
    effects = cases(gripper) if size else []
    plant, ids = Plant(gripper, 1 + len(effects), "fast", threads=1), np.arange(1 + len(effects))
    plant.attach(
        [(e(size(e)[None], plant.dt, variant), np.array([row])) for row, (e, variant) in enumerate(effects, 1)]
    )
    grasp = GraspSampler(GraspConfig(), gripper)(np.random.default_rng(3), np.arange(1))
    base = {name: np.repeat(value, len(ids)) for name, value in base_parameters(gripper, grasp).items()}
    plant.reset(ids, write_base(plant, ids, base))
    touch, seen = gripper.contact_position(grasp.radius_m[0]), []
    for share in COMMAND:
        command = np.clip(touch + share * gripper.stroke, 0, gripper.stroke)
        plant.advance(np.full((len(ids), plant.motors), command), round(gripper.period_s / plant.dt))
        position, force = plant.measured_position.copy(), plant.measured_force.copy()
        for row, (effect, _) in enumerate(effects, 1):
            if is_rounding(effect):  # of readings, after a noise of 0
                steps = size(effect)
                position[row], force[row] = (
                    with_noise(v[row], 0.0, 0.0, s) for v, s in zip((position, force), steps, strict=True)
                )
        seen.append(np.concatenate([position, force], axis=1))
    assert not plant.warnings().any()
    return np.array(seen)


@pytest.fixture(scope="module")
def plain(gripper) -> np.ndarray:
    return roll(gripper, None)[:, 0]


def test_the_grasp_is_worth_looking_at(gripper, plain):
    force = plain[:, len(gripper.motors) :]
    assert (force.max(axis=0) > 4 * gripper.training.contact_threshold_n).all()
    if gripper.force == "sensors":  # a motor's effort moves the fingers, too
        assert (force[RELEASED] < gripper.training.contact_threshold_n).all(), "not released"


def test_null_values_leave_every_bit(gripper, plain):
    seen = roll(gripper, lambda effect: effect.null_values())
    changed = [case for row, case in enumerate(cases(gripper), 1) if not np.array_equal(seen[:, row], plain)]
    assert changed == []
    np.testing.assert_array_equal(seen[:, 0], plain)


def test_typical_sizes_change_what_is_read(gripper, plain):
    seen = roll(gripper, lambda effect: effect.typical_values())
    assert np.isfinite(seen).all()
    np.testing.assert_array_equal(seen[:, 0], plain)
    widths = np.ptp(plain, axis=0)
    change = (np.abs(seen - plain[:, None]) / widths).max(axis=(0, 2))
    same = [(effect.name, variant) for row, (effect, variant) in enumerate(cases(gripper), 1) if change[row] < 1e-4]
    assert same == []


def test_a_contact_without_friction_is_left_out_where_pads_turn():
    hunt_crossley = catalogue()["hunt_crossley_contact"]
    for name in shipped_grippers():
        why = why_left_out(hunt_crossley, load_gripper(name))
        assert why == ("needs pads that stay parallel; those of so101_gripper turn" if name == "so101_gripper" else "")
