"""Commands act later on one finger than on the other."""

from __future__ import annotations

import dataclasses

import numpy as np

from forcegrasp.effects.base import Nested, State, delay_line
from forcegrasp.effects.command_delay import CommandDelay
from forcegrasp.effects.each_finger import SHARE, of_each


class DelayAsymmetry(CommandDelay):
    """Dead time of which each motor has its own: one after the other on a bus, or drivers that differ.

    At a = 1 the left finger alone is late, at a = −1 the right one, and at a = 0 both are alike.
    """

    name = "delay_asymmetry"
    least_motors = 2
    symptom = "one finger begins each motion later than the other, by the same time however fast it is"
    formula = "u'_l(t) = u_l(t − (1 + a) d), u'_r(t) = u_r(t − (1 − a) d)"
    source = "dead time of each bus node and driver"
    look_alikes = ("command_delay", "actuator_lag", "motor_asymmetry", "backlash_asymmetry")
    separates = "steps in free air: servos of unlike gains start together, and lost motion is lost at reversals alone"
    parameters = (
        dataclasses.replace(CommandDelay.parameters[0], doc="mean time d until a command acts", trials=(0.01, 0.04)),
        SHARE,
    )
    contains = (Nested("command_delay", at={"share": 0.0}, same={"delay_s": "delay_s"}),)
    order = 2

    @classmethod
    def at_whole_steps(cls, values: np.ndarray, dt: float) -> tuple[np.ndarray, np.ndarray | float]:
        return values, 0.0  # fingers that are late by unlike times have no common shift

    def init(self, which: np.ndarray) -> State:
        steps = of_each(self, "delay_s")[which] / self.dt
        return delay_line(self.resting_command[which], steps, 2 * self.longest("delay_s") / self.dt)
