"""Positions are read by a wrong scale."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Parameter
from forcegrasp.effects.wrong_encoder import WrongEncoder


class EncoderScale(WrongEncoder):
    """Each finger's encoder reads too much, or too little, by a share of the way from where the gripper is closed.

    ``reading``: only what is recorded is off. ``loop``: the servo itself acts on the encoder, and so stands off by it.
    """

    name = "encoder_scale"
    symptom = "positions are off in proportion to the opening; large objects are touched late, small ones in time"
    formula = "q' = (1 + e) q, per finger"
    source = "gear ratio or lever arm that is not the nominal one"
    look_alikes = ("encoder_bias", "object_size", "motor_offset")
    separates = "wide and narrow openings: a bias is the same at both"
    parameters = (
        Parameter("left_error", "share that the left encoder reads too much", "1", -0.3, 0.3, 0.02),
        Parameter("right_error", "share that the right encoder reads too much", "1", -0.3, 0.3, 0.02),
    )
    order = 5
    alone = "scale"

    @classmethod
    def trials(cls) -> np.ndarray:
        return np.array([[0.01, 0.0], [0.0, 0.01]])

    def true_position(self, read: np.ndarray) -> np.ndarray:
        return read / (1 + self.values)

    def read_position(self, position: np.ndarray) -> np.ndarray:
        return position * (1 + self.values)
