"""One sensor reads part of the other's force."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Effect, Parameter
from forcegrasp.effects.each_finger import SIDES


class ForceCrosstalk(Effect):
    """Each force reading has a share of the other finger's in it, the left one perhaps more than the right one."""

    name = "force_crosstalk"
    stage = "sensor"
    family = "sensor gain"
    symptom = "one finger reads a force when only the other touches"
    formula = "f'_l = f_l + (c + d) f_r, f'_r = f_r + (c − d) f_l"
    source = "shared wiring or structure"
    look_alikes = ("force_gain_asymmetry",)
    separates = "off-centre objects, where only one finger touches; with both in contact it is a gain and can't be told"
    parameters = (
        Parameter("share", "mean share c", "1", -0.5, 0.5, 0.08),
        Parameter("difference", "by how much the left one's is larger than c, d", "1", -0.5, 0.5, 0.02, if_missing=0.0),
    )
    least_channels = 2

    @classmethod
    def trials(cls) -> np.ndarray:
        return np.array([[0.05, 0.0], [0.0, 0.05]])

    def read_force(self, force: np.ndarray) -> np.ndarray:
        shares = self["share"] + self["difference"] * SIDES
        return np.where(shares == 0, force, force + shares * force[:, ::-1])
