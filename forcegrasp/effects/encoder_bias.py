"""Positions are read with an offset."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Parameter
from forcegrasp.effects.wrong_encoder import WrongEncoder


class EncoderBias(WrongEncoder):
    """An offset of each finger's encoder.

    ``reading``: only what is recorded is off. ``loop``: the servo itself acts on the encoder, and so stands off by it.
    """

    name = "encoder_bias"
    symptom = "positions are off by a constant, in free air and in contact"
    formula = "q' = q + b, per finger"
    source = "homing error"
    look_alikes = ("encoder_scale", "coulomb_friction", "finger_compliance", "motor_offset")
    separates = "approaching one command from both sides: a bias does not flip; a harder servo: a bias stays as it is"
    parameters = (
        Parameter("left_m", "offset of the left encoder", "m", -0.01, 0.01, 0.0003, follows="position"),
        Parameter("right_m", "offset of the right encoder", "m", -0.01, 0.01, -0.0002, follows="position"),
    )
    order = 9
    alone = "offset"

    @classmethod
    def trials(cls) -> np.ndarray:
        return np.array([[2e-4, 0.0], [0.0, 2e-4]])

    def true_position(self, read: np.ndarray) -> np.ndarray:
        return read - self.values

    def read_position(self, position: np.ndarray) -> np.ndarray:
        return position + self.values
