"""Forces and shifts that effects put on fingers, pads and object reach the right one, and the right way."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from forcegrasp.effects import Contribution, Effect
from forcegrasp.physics.gripper_file import load_gripper
from forcegrasp.physics.plant import Plant

SECOND = str(Path(__file__).parents[1] / "grippers" / "second.yaml")


class Push(Effect):
    """Constant forces: on the left finger, on the right one, on the object."""

    name, stage, parameters = "push", "contact", ()
    newtons = (0.0, 0.0, 0.0)

    def act(self) -> Contribution:
        return Contribution(finger_push_n=np.array(self.newtons[:2]), object_push_n=np.array(self.newtons[2]))


def _moved(gripper: str, newtons: tuple[float, float, float], seconds: float) -> tuple[np.ndarray, float]:
    """How far fingers and object have moved from a row without pushes, metres."""
    plant = Plant(load_gripper(gripper), 2, threads=1)
    push = type("Push", (Push,), {"newtons": newtons})
    plant.attach([(push(np.empty((1, 0)), plant.dt), np.array([1]))])
    plant.reset(np.arange(2), np.zeros(2), np.full((2, 2), 0.04))
    plant.advance(np.full((2, 2), 0.04), round(seconds / plant.dt))
    return plant.position[1] - plant.position[0], float(np.diff(plant.object_position)[0])


@pytest.mark.parametrize(
    ("gripper", "stiffness", "friction_n"), [("tiago", 100.0, 0.0), (SECOND, 250.0, 0.05)], ids=["tiago", "second"]
)
def test_a_finger_yields_towards_opening_as_far_as_its_servo_lets_it(gripper, stiffness, friction_n):
    pushes = np.array([0.1, 0.3])
    fingers, thing = _moved(gripper, (*pushes, 0.0), seconds=1.5)
    np.testing.assert_allclose(fingers, pushes / stiffness, atol=friction_n / stiffness + 2e-5)
    assert thing == 0


@pytest.mark.parametrize(("gripper", "newtons"), [("tiago", 6.0), (SECOND, 1.0)], ids=["tiago", "second"])
@pytest.mark.parametrize("side", [-1, 1])
def test_an_object_goes_where_it_is_pushed(gripper, newtons, side):
    fingers, thing = _moved(gripper, (0.0, 0.0, side * newtons), seconds=0.04)
    assert 3e-4 < side * thing < 0.01
    assert not fingers.any()


class ShiftOfTheRightPad(Effect):
    """The right pad stands 2 mm further out, which is towards opening."""

    name, stage, parameters = "shift", "transmission", ()

    def act(self) -> Contribution:
        return Contribution(pad_shift_m=np.array([0.0, 0.002]))


@pytest.mark.parametrize("gripper", ["tiago", SECOND], ids=["tiago", "second"])
def test_each_pad_has_a_shift_of_its_own(gripper):
    plant = Plant(load_gripper(gripper), 1, threads=1)
    plant.attach([(ShiftOfTheRightPad(np.empty((1, 0)), plant.dt), np.array([0]))])
    plant.reset(np.arange(1), np.zeros(1), np.full((1, 2), 0.04))
    plant.advance(np.full((1, 2), 0.04))
    moved = np.abs(plant.field("geom_pos")[0] - plant.model.geom_pos).max(axis=1)
    left, right = (plant.model.geom_bodyid == plant.model.body(finger.body).id for finger in plant.gripper.fingers)
    np.testing.assert_allclose(moved, np.where(right, 0.002, 0.0), atol=1e-12)
    assert left.any()
    assert right.any()
    plant.reset(np.arange(1), np.zeros(1))
    assert not plant.pad_shift_m.any()  # until the next step
