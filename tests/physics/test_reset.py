"""Where motors stand when a grasp is started anew, and what is read then."""

from __future__ import annotations

import numpy as np
import pytest

from forcegrasp.physics.gripper_file import load_gripper, shipped_grippers
from forcegrasp.physics.plant import Plant


@pytest.mark.parametrize("name", shipped_grippers())
def test_motors_are_held_where_they_start_without_effort(name):
    """The effort read at the first row was that towards the keyframe's command, wherever the motors stood."""
    gripper = load_gripper(name)
    plant = Plant(gripper, 3)
    starts = gripper.stroke * np.array([[1.0], [0.9], [0.8]]) * np.ones(plant.motors)
    plant.reset(np.array([1, 2]), np.zeros(2), starts[1:])
    plant.advance(starts, 5)
    after = plant.measured_force[1:].copy()
    plant.reset(np.array([1, 2]), np.zeros(2), starts[1:])
    np.testing.assert_allclose(plant.measured_position[1:], starts[1:], atol=1e-9)
    np.testing.assert_allclose(plant.measured_force[1:], after, atol=0.1 * gripper.training.force_std_n)
