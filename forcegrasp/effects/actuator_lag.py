"""The actuator follows its command through a low-pass filter."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Effect, Parameter, State
from forcegrasp.effects.low_pass import ORDERS, low_pass


class ActuatorLag(Effect):
    """A filter between the command and the servo, of first order unless it is said.

    ``butterworth``: one of second order with the same corner frequency 1/(2πτ), as drives that smooth set points have.
    """

    name = "actuator_lag"
    stage = "actuator"
    family = "delay"
    symptom = "like a delay, but rounded: steps in the command arrive as exponentials"
    formula = "τ du'/dt = u − u'; τ² d²u'/dt² + √2 τ du'/dt = u − u' (butterworth)"
    source = "first-order lag; MuJoCo's `dyntype=filterexact` does the same for one value per model; Butterworth 1930"
    look_alikes = ("command_delay", "second_order_lag", "rate_limited_lag", "rate_limit")
    separates = "fast steps: a lagged response has no corner"
    parameters = (Parameter("time_constant_s", "time constant τ", "s", 0.0, 0.5, 0.05, trials=(0.01, 0.04, 0.12)),)
    variants = known_beforehand = ORDERS

    def init(self, which: np.ndarray) -> State:
        held = self.resting_command[which]
        return {"held": held, "rate": np.zeros_like(held)}

    def command(self, command: np.ndarray, fresh: np.ndarray) -> np.ndarray:
        self.state["held"] = held = low_pass(self, command, self.state["held"])
        return held
