"""Depths of pads in an object: from where it begins, once it was felt, until the row is reset."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from forcegrasp.effects import Effect
from forcegrasp.effects.touch import depth_in_object, untouched
from forcegrasp.physics.gripper_file import load_gripper
from forcegrasp.physics.plant import Plant


class Feeler(Effect):
    """Remembers surfaces and nothing else."""

    name, stage, parameters = "feeler", "contact", ()

    def init(self, which: np.ndarray) -> dict[str, np.ndarray]:
        return {"surface": untouched(which)}


@pytest.fixture
def feeler() -> Feeler:
    return Feeler(np.empty((2, 0)), 0.002)


def _depth(feeler: Feeler, position: float, force: float, thing: float = 0.0, inside: float = 0.0) -> np.ndarray:
    """Of both fingers at one position, in both rows, metres, ``(2, 2)``; felt so far inside the object."""
    both = np.full((2, 2), position)
    plant = SimpleNamespace(
        pad_position=both,
        pad_shift_m=np.zeros((2, 2)),
        object_position=np.full(2, thing),
        clearance=lambda rows: np.full((len(rows), 2, 3), [-inside, 3e-4, np.inf]),
    )
    return depth_in_object(feeler.attach(plant, np.arange(2)), np.full((2, 2), force))


def test_depth_counts_from_the_first_touch(feeler):
    assert (_depth(feeler, 0.030, 0.0) == -np.inf).all()
    np.testing.assert_array_equal(_depth(feeler, 0.025, 0.1), 0.0)
    np.testing.assert_allclose(_depth(feeler, 0.024, 0.5), 0.001)
    np.testing.assert_allclose(_depth(feeler, 0.026, 0.0), -0.001)  # let go, but not forgotten


def test_what_a_step_went_too_far_before_the_touch_was_felt_counts():
    felt = Feeler(np.empty((2, 0)), 0.008)
    np.testing.assert_allclose(_depth(felt, 0.025, 0.1, inside=3e-4), 3e-4)
    np.testing.assert_allclose(_depth(felt, 0.024, 0.1), 0.0013)


@pytest.mark.parametrize("tier", ["reference", "fast"])
def test_distance_from_an_object_is_that_of_its_shape(tier):
    """Also where the scene has MuJoCo's older collision code, as TIAGo's."""
    plant = Plant(load_gripper("tiago"), 2, tier, threads=1)
    plant.write_radius(np.arange(2), np.array([0.02, 0.025]))
    plant.reset(np.arange(2), np.array([0.001, 0.0]), np.array([[0.03, 0.03], [0.024, 0.026]]))
    apart = plant.clearance(np.arange(2)).min(axis=2)
    np.testing.assert_allclose(apart, [[0.011, 0.009], [-0.001, 0.001]], atol=2e-5)


def test_an_object_that_moves_right_is_deeper_on_the_right(feeler):
    _depth(feeler, 0.025, 0.1)
    np.testing.assert_allclose(_depth(feeler, 0.025, 0.1, thing=0.002), [[-0.002, 0.002]] * 2)


def test_a_reset_forgets_the_surface_of_its_rows_alone(feeler):
    _depth(feeler, 0.025, 0.1)
    feeler.reset(np.array([1]))
    np.testing.assert_allclose(_depth(feeler, 0.020, 0.1), [[0.005, 0.005], [0.0, 0.0]], atol=1e-15)


@pytest.mark.parametrize("gripper", ["tiago", "franka_hand", "so101_gripper"])
def test_the_mass_between_pad_and_object_is_that_of_both(gripper):
    """Each finger with its motor; both with the one motor; the object alone against a jaw that stands still."""
    plant = Plant(load_gripper(gripper), 1, threads=1)
    plant.reset(np.arange(1), np.zeros(1))
    motors, thing = plant.inertia[0], plant.model.dof_M0[plant.object_dof]
    if gripper == "franka_hand":
        motors = motors / (plant.travel**2).sum()
    elif gripper == "so101_gripper":
        motors = np.where(plant.travel == 0, np.inf, motors / max(plant.travel**2))
    np.testing.assert_allclose(plant.mass_between(np.arange(1))[0], 1 / (1 / motors + 1 / thing) + np.zeros(2))
