"""Commands move no faster than a limit."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Effect, Parameter, State


class RateLimit(Effect):
    """The driver follows steps with a ramp of constant slope."""

    name = "rate_limit"
    stage = "command"
    family = "drive limit"
    needs_position_loop = True
    symptom = "fast commands become ramps of one constant slope; slow ones are followed"
    formula = "|du'/dt| ≤ v"
    source = "slew limit of position drivers"
    look_alikes = ("rate_limited_lag", "force_limit", "actuator_lag", "command_delay", "back_emf")
    separates = "steps of several sizes: the slope stays, the time to arrive grows with the step"
    parameters = (
        Parameter(
            "rate_m_s",
            "fastest change of the command",
            "m/s",
            0.001,
            2.0,
            0.012,
            null=np.inf,
            logarithmic=True,
            trials=(0.004, 0.01, 0.025, 0.06, 0.15, 0.4),
            follows="position",
        ),
    )
    order = 3
    known_beforehand = ("",)

    def init(self, which: np.ndarray) -> State:
        return {"held": self.position[which]}

    def command(self, command: np.ndarray, fresh: np.ndarray) -> np.ndarray:
        held, step = self.state["held"], self["rate_m_s"] * self.dt
        limited = held + np.clip(command - held, -step, step)
        self.state["held"] = held = np.where(np.isinf(step), command, limited)
        return held
