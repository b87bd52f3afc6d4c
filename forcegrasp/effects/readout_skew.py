"""Positions are read later than they are said to be."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Effect, Parameter, State, all_delayed, delay_line, delayed
from forcegrasp.physics.gripper import SKEW


class ReadoutSkew(Effect):
    """A position that is older than its row says, by any part of a period: a buffer, a bus, a filter in the encoder."""

    name = "readout_skew"
    stage = "sensor"
    base_parameter = SKEW
    family = "delay"
    symptom = "positions are shifted in time against all else; what happens, and the forces, are right"
    formula = "q'(t) = q(t − d)"
    source = "age of a position in a bus's reply or an encoder's buffer"
    look_alikes = ("command_delay", "actuator_lag", "force_delay")
    separates = (
        "a start from rest is as late with either, but a delayed command leaves readings of a motion that goes on, such"
        " as a joint let go or pushed by hand, in time with the efforts and forces that go with it"
    )
    parameters = (Parameter("delay_s", "age of a position", "s", 0.0, 0.2, 0.03, trials=(0.01, 0.04)),)
    order = 8
    least_steps = 1.0

    def init(self, which: np.ndarray) -> State:
        steps = self["delay_s"][which] / self.dt
        past = np.full((len(which), self.motors), np.nan)
        return delay_line(past, steps, self.longest("delay_s") / self.dt)

    def read_position(self, position: np.ndarray) -> np.ndarray:
        return delayed(self.state, position)

    def read_positions(self, positions: np.ndarray) -> np.ndarray:
        return all_delayed(self.state, positions)
