"""Force readings are off by a constant."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Effect, Parameter


class ForceBias(Effect):
    """An offset of each force sensor."""

    name = "force_bias"
    stage = "sensor"
    family = "force sensor"
    symptom = "force is not zero in free air"
    formula = "f' = f + b, per finger"
    source = "sensor offset"
    look_alikes = ("force_drift", "adhesion", "force_deadzone")
    separates = "free motion before contact gives it directly"
    parameters = (
        Parameter("left_n", "offset of the left sensor", "N", -2.0, 2.0, 0.06, follows="force"),
        Parameter("right_n", "offset of the right sensor", "N", -2.0, 2.0, 0.04, follows="force"),
    )
    order = 8
    per, alone = "channel", "offset"
    least_channels = 1

    @classmethod
    def trials(cls) -> np.ndarray:
        return np.array([[0.05, 0.0], [0.0, 0.05]])

    def read_force(self, force: np.ndarray) -> np.ndarray:
        return force + self.values
