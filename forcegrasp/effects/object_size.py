"""Objects that are larger, or smaller, than the set says."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Effect, Parameter
from forcegrasp.physics.plant import Plant


class ObjectSize(Effect):
    """An error of all radii that a set gives: the calliper's zero, paper around the objects, a diameter misread."""

    name = "object_size"
    stage = "object"
    family = "measurement set"
    of_set = True
    needs_object = True
    symptom = "contact comes early or late by the same way, whatever the object"
    formula = "r' = r + e"
    source = "the measurement set, not the gripper"
    look_alikes = ("backlash", "encoder_bias")
    separates = "a calliper; off-centre objects, and readings in free air, which an encoder's error shifts"
    parameters = (
        Parameter(
            "error_m", "e, added to the radii of the set", "m", -0.004, 0.004, 0.0003,
            trials=(0.0003, -0.0003, 0.0015, -0.0015),
        ),
    )  # fmt: skip

    def change_model(self, plant: Plant, which: np.ndarray) -> None:
        error = self["error_m"][which, 0]
        changed = error != 0
        plant.change_radius(self.rows[which][changed], error[changed])
