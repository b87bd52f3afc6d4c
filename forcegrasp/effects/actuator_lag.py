"""The actuator follows its command with a first-order lag."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Effect, Parameter, State


class ActuatorLag(Effect):
    """A filter between the command and the servo."""

    name = "actuator_lag"
    stage = "actuator"
    family = "delay"
    symptom = "like a delay, but rounded: steps in the command arrive as exponentials"
    formula = "τ du'/dt = u − u'"
    source = "first-order lag; MuJoCo's `dyntype=filterexact` does the same for one value per model"
    look_alikes = ("command_delay", "rate_limited_lag", "rate_limit")
    separates = "fast steps: a lagged response has no corner"
    parameters = (Parameter("time_constant_s", "time constant τ", "s", 0.0, 0.5, 0.05, trials=(0.01, 0.04, 0.12)),)
    known_beforehand = ("",)

    def init(self, which: np.ndarray) -> State:
        return {"held": self.resting_command[which]}

    def command(self, command: np.ndarray, fresh: np.ndarray) -> np.ndarray:
        held, weight = self.state["held"], self.lag_weight("time_constant_s")
        self.state["held"] = held = np.where(weight == 1, command, held + weight * (command - held))
        return held
