"""Force readings end at a level."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Effect, Parameter


class ForceSaturation(Effect):
    """A sensor that reads no more than its range."""

    name = "force_saturation"
    stage = "sensor"
    family = "force sensor"
    symptom = "force reaches a plateau at one value, for all objects alike, while the finger goes on closing"
    formula = "f' = clip(f, −F, F)"
    source = "range of the sensor or its amplifier"
    look_alikes = ("force_limit",)
    separates = "the finger's position, and objects that need more force"
    parameters = (
        Parameter(
            "level_n",
            "largest reading F",
            "N",
            0.02,
            100.0,
            0.5,
            null=np.inf,
            logarithmic=True,
            trials=tuple(np.geomspace(0.08, 5, 14)),
            follows="force",
        ),
    )
    order = 8
    least_channels = 1

    def read_force(self, force: np.ndarray) -> np.ndarray:
        return np.clip(force, -self["level_n"], self["level_n"])
