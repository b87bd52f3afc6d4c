"""The two force sensors have different gains."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Effect, Parameter
from forcegrasp.effects.each_finger import SIDES


class ForceGainAsymmetry(Effect):
    """The left sensor reads more and the right one less by the same share; what is common is the force scale."""

    name = "force_gain_asymmetry"
    stage = "sensor"
    family = "sensor gain"
    symptom = "left and right forces differ by a factor"
    formula = "f'_l = (1 + a) f_l, f'_r = (1 − a) f_r"
    source = "calibration of each sensor"
    look_alikes = ("force_crosstalk", "object_friction", "object_pull", "motor_asymmetry")
    separates = "long holds, where both fingers press alike"
    parameters = (Parameter("share", "share a", "1", -0.9, 0.9, 0.1, trials=(0.05,)),)
    order = 2
    least_channels = 2

    def read_force(self, force: np.ndarray) -> np.ndarray:
        return force * (1 + self["share"] * SIDES)
