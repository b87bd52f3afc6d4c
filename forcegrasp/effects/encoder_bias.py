"""Positions are read with an offset."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Effect, Parameter


class EncoderBias(Effect):
    """An offset of each finger's encoder.

    ``reading``: only what is recorded is off. ``loop``: the servo itself acts on the encoder, and so stands off by it.
    """

    name = "encoder_bias"
    stage = "sensor"
    family = "offset"
    symptom = "positions are off by a constant, in free air and in contact"
    formula = "q' = q + b, per finger"
    source = "homing error"
    look_alikes = ("encoder_scale", "coulomb_friction", "finger_compliance", "motor_offset")
    separates = "approaching one command from both sides: a bias does not flip; a harder servo: a bias stays as it is"
    parameters = (
        Parameter("left_m", "offset of the left encoder", "m", -0.01, 0.01, 0.0003, follows="position"),
        Parameter("right_m", "offset of the right encoder", "m", -0.01, 0.01, -0.0002, follows="position"),
    )
    variants = ("reading", "loop")
    known_beforehand = ("loop",)
    variant_needs = {"loop": "position loop"}  # noqa: RUF012 never changed
    order = 9
    per, alone = "motor", "offset"

    @classmethod
    def trials(cls) -> np.ndarray:
        return np.array([[2e-4, 0.0], [0.0, 2e-4]])

    @classmethod
    def reads_only(cls, variant: str = "") -> bool:
        return variant != "loop"

    def rests_at(self, command: np.ndarray) -> np.ndarray:
        return command if self.variant == "reading" else command - self.values

    def command(self, command: np.ndarray, fresh: np.ndarray) -> np.ndarray:
        return self.rests_at(command)

    def read_position(self, position: np.ndarray) -> np.ndarray:
        return position + self.values
