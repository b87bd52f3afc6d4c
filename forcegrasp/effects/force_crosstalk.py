"""One sensor reads part of the other's force."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Effect, Parameter


class ForceCrosstalk(Effect):
    """Each force reading has a share of the other finger's in it."""

    name = "force_crosstalk"
    stage = "sensor"
    family = "sensor gain"
    symptom = "one finger reads a force when only the other touches"
    formula = "f'_l = f_l + c f_r, f'_r = f_r + c f_l"
    source = "shared wiring or structure"
    look_alikes = ("force_gain_asymmetry",)
    separates = "off-centre objects, where only one finger touches; with both in contact it is a gain and can't be told"
    parameters = (Parameter("share", "share c", "1", -0.5, 0.5, 0.08, trials=(0.05,)),)
    least_channels = 2

    def read_force(self, force: np.ndarray) -> np.ndarray:
        return np.where(self["share"] == 0, force, force + self["share"] * force[:, ::-1])
