"""Forces are read late."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import DelayLine, Effect, Parameter


class ForceDelay(Effect):
    """Dead time of the force sensors."""

    name = "force_delay"
    stage = "sensor"
    symptom = "force is shifted in time against position"
    formula = "f'(t) = f(t − d)"
    source = "dead time; MuJoCo's sensor `delay` does the same for one value per model"
    look_alikes = ("force_lag", "command_delay")
    separates = "fast steps and first contact: a delayed force keeps its corner"
    parameters = (Parameter("delay_s", "age of a reading", "s", 0.0, 0.5, 0.08, trials=(0.01, 0.03, 0.08, 0.2)),)
    order = 4
    least_channels = 1

    def start(self) -> None:
        self._line = DelayLine(len(self.values), self.channels, self.longest("delay_s") / self.dt)

    def reset(self, which: np.ndarray) -> None:
        self._line.reset(which, self["delay_s"][which, 0] / self.dt)

    def read_force(self, force: np.ndarray) -> np.ndarray:
        return self._line(force, new=self.new_reading[:, 0])
