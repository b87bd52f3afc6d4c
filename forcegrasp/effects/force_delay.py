"""Forces are read late."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Effect, Parameter, State, all_delayed, delay_line, delayed


class ForceDelay(Effect):
    """Dead time of the force sensors."""

    name = "force_delay"
    stage = "sensor"
    family = "force sensor"
    symptom = "force is shifted in time against position"
    formula = "f'(t) = f(t − d)"
    source = "dead time; MuJoCo's sensor `delay` does the same for one value per model"
    look_alikes = ("force_lag", "command_delay")
    separates = "fast steps and first contact: a delayed force keeps its corner"
    parameters = (Parameter("delay_s", "age of a reading", "s", 0.0, 0.5, 0.08, trials=(0.01, 0.03, 0.08, 0.2)),)
    order = 4
    least_steps = 1.0
    least_channels = 1

    def init(self, which: np.ndarray) -> State:
        unknown = np.full((len(which), self.channels), np.nan)
        return delay_line(unknown, self["delay_s"][which] / self.dt, self.longest("delay_s") / self.dt)

    def read_force(self, force: np.ndarray) -> np.ndarray:
        return delayed(self.state, force)

    def read_forces(self, forces: np.ndarray) -> np.ndarray:
        return all_delayed(self.state, forces)
