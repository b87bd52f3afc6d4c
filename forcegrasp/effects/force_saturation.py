"""Force readings end at a level."""

from __future__ import annotations

import dataclasses

import numpy as np

from forcegrasp.effects.base import Effect, Parameter
from forcegrasp.effects.bent import KNEE, bent


class ForceSaturation(Effect):
    """A sensor that reads no more than its range, and may bend towards it.

    At k = 0 it reads all up to F as it is; with k = 0.4 nearly as F tanh(f / F), with k = 1 half of F at F.
    """

    name = "force_saturation"
    stage = "sensor"
    family = "force sensor"
    symptom = "force reaches a plateau at one value, for all objects alike, while the finger goes on closing"
    formula = "f' = f / (1 + |f / F|^(1/k))^k, which is clip(f, −F, F) at k = 0"
    source = "range of the sensor or its amplifier; the blend of two asymptotes of Churchill and Usagi (1972)"
    look_alikes = ("force_limit", "smooth_force_limit")
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
        dataclasses.replace(KNEE, trials=(0.0, 0.4), if_missing=0.0),
    )
    order = 9
    least_channels = 1

    def read_force(self, force: np.ndarray) -> np.ndarray:
        return bent(force, self["level_n"], self["knee"])
