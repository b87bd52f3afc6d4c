"""Positions are read with an offset."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Effect, Parameter


class EncoderBias(Effect):
    """An offset of each finger's encoder; commands are not affected."""

    name = "encoder_bias"
    stage = "sensor"
    symptom = "positions are off by a constant, in free air and in contact"
    formula = "q' = q + b, per finger"
    source = "homing error"
    look_alikes = ("coulomb_friction", "finger_compliance")
    separates = "approaching one command from both sides: a bias does not flip"
    parameters = (
        Parameter("left_m", "offset of the left encoder", "m", -0.01, 0.01, 0.0003),
        Parameter("right_m", "offset of the right encoder", "m", -0.01, 0.01, -0.0002),
    )
    order = 9

    @classmethod
    def trials(cls) -> np.ndarray:
        return np.array([[2e-4, 0.0], [0.0, 2e-4]])

    def read_position(self, position: np.ndarray) -> np.ndarray:
        return position + self.values
