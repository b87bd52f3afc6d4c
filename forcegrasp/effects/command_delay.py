"""Commands act a fixed time after they were given."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Effect, Parameter, State, all_delayed, delay_line, delayed


class CommandDelay(Effect):
    """Dead time between a command and the motor, as buses and drivers have it."""

    name = "command_delay"
    stage = "command"
    family = "delay"
    symptom = "all motion is shifted in time alike, in free air and in contact"
    formula = "u'(t) = u(t − d)"
    source = "dead time; MuJoCo's actuator `delay` does the same for one value per model"
    look_alikes = ("actuator_lag", "force_delay", "readout_skew", "delay_asymmetry")
    separates = "fast steps: a delayed response keeps its corner, a lagged one is rounded"
    parameters = (Parameter("delay_s", "time until a command acts", "s", 0.0, 0.4, 0.06, trials=(0.015, 0.05, 0.12)),)
    order = 1  # after a dead band, which is the driver's
    least_steps = 1.0
    known_beforehand = ("",)

    def init(self, which: np.ndarray) -> State:
        steps = self["delay_s"][which] / self.dt
        return delay_line(self.resting_command[which], steps, self.longest("delay_s") / self.dt)

    @classmethod
    def at_whole_steps(cls, values: np.ndarray, dt: float) -> tuple[np.ndarray, np.ndarray | float]:
        whole = dt * np.ceil(np.round(values / dt, 6))  # 0.004 / 0.002 may be more than 2
        return whole, (whole - values)[:, 0]

    def command(self, command: np.ndarray, fresh: np.ndarray) -> np.ndarray:
        return delayed(self.state, command)

    def commands(self, commands: np.ndarray, fresh: np.ndarray) -> np.ndarray:
        return all_delayed(self.state, commands)
