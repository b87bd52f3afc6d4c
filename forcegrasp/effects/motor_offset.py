"""A constant force besides the motors' own."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Contribution, Effect, Parameter


class MotorOffset(Effect):
    """A constant force on each motor: gravity on a tilted drive, the offset of an amplifier, a cable that pulls."""

    name = "motor_offset"
    stage = "actuator"
    family = "offset"
    symptom = "each motor rests off its command by a constant, to the same side wherever it comes from"
    formula = "F' = F + F_0, per motor; positive opens"
    source = "offset of the drive's force: Janot, Gautier and Brunot (2019), identification of EMPS"
    look_alikes = ("encoder_bias", "motor_asymmetry", "force_bias", "object_pull", "coulomb_friction")
    separates = (
        "a harder servo rests nearer to its command, a biased encoder does not; the effort that is read is right, a"
        " biased reading's is not; friction flips with the direction"
    )
    parameters = (
        Parameter("left_n", "offset of the left motor", "N", -0.5, 0.5, 0.03, follows="effort"),
        Parameter("right_n", "offset of the right motor", "N", -0.5, 0.5, -0.02, follows="effort"),
    )
    order = 3
    per, alone = "motor", "offset"
    acts_alike = True

    @classmethod
    def trials(cls) -> np.ndarray:
        return np.array([[0.02, 0.0], [0.0, 0.02]])

    def act(self) -> Contribution:
        return Contribution(motor_push=self.values)
