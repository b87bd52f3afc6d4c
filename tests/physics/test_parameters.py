"""The set of numbers that makes a grasp."""

from __future__ import annotations

import numpy as np
import pytest

from forcegrasp.physics import GraspParameters, default_gripper


def test_softness_interpolates_between_hard_and_soft():
    training, kappa = default_gripper().training, np.array([0.0, 0.25, 0.5, 1.0])
    np.testing.assert_allclose(training.at("rho_m", kappa), [0.003, 0.00475, 0.0065, 0.010], rtol=1e-15)
    np.testing.assert_allclose(training.force_scale(kappa), [5, 3.875, 2.75, 0.5], rtol=1e-15)


def test_softness_of_a_force_scale_is_the_inverse_and_stays_a_softness():
    kappa = default_gripper().training.kappa_of_force_scale(np.array([5, 3.875, 0.5]))
    np.testing.assert_allclose(kappa, [0, 0.25, 1], rtol=1e-15)
    beyond = default_gripper().training.kappa_of_force_scale(np.array([9.0, 0.1]))  # the paper's interval
    np.testing.assert_array_equal(beyond, [0, 1])


def test_scalars_are_broadcast_and_nothing_is_shared():
    kappa = np.array([0.1, 0.2, 0.3])
    grasps = GraspParameters(kappa, -9, 0.025, 0, 0.1)
    assert len(grasps) == 3
    assert all(getattr(grasps, name).shape == (3,) for name in ("kappa", "b2", "radius_m", "offset_m", "goal_force_n"))
    kappa[0] = 7
    grasps.b2[0] = 1
    assert grasps.kappa[0] == 0.1
    assert grasps.b2[1] == -9


def test_mismatched_lengths_are_refused():
    with pytest.raises(ValueError, match="shape"):
        GraspParameters([0.1, 0.2], [-9, -8, -7], 0.025, 0, 0.1)


def test_array_round_trip_keeps_the_order_of_the_fields(draw):
    grasps = draw(5)
    array = grasps.as_array()
    assert array.shape == (5, 5)
    np.testing.assert_array_equal(array[:, 2], grasps.radius_m)
    np.testing.assert_array_equal(array[:, 4], grasps.goal_force_n)
    np.testing.assert_array_equal(GraspParameters.from_array(array).as_array(), array)


def test_index_and_concatenate(draw):
    grasps = draw(5)
    assert len(grasps[2]) == 1
    assert grasps[2].radius_m[0] == grasps.radius_m[2]
    joined = GraspParameters.concatenate([grasps[np.array([3, 1])], grasps[4]])
    np.testing.assert_array_equal(joined.as_array(), grasps.as_array()[[3, 1, 4]])


def test_describe_names_every_parameter():
    text = GraspParameters([0.1, 0.25], -9, 0.025, -0.004, 0.3).describe(1)
    assert text == "kappa=0.25, b2=-9, radius_m=0.025, offset_m=-0.004, goal_force_n=0.3"
