"""Commands are followed with a lag, and no faster than a limit."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Effect, Nested, Parameter, State


class RateLimitedLag(Effect):
    """A driver's own position loop with a limit of its speed: ramps that bend towards their ends.

    At τ = 0 it is a rate limit.
    """

    name = "rate_limited_lag"
    stage = "command"
    family = "drive limit"
    needs_position_loop = True
    symptom = "fast commands become ramps whose ends are rounded; slow ones are followed a little late"
    formula = "du'/dt = clip((u − u') / τ, −v, v)"
    source = "proportional position loop around a drive of limited speed, as cascaded controllers have it"
    look_alikes = ("rate_limit", "actuator_lag", "back_emf")
    separates = "steps of several sizes: large ones show the limit, small ones the lag"
    parameters = (
        Parameter(
            "rate_m_s", "fastest change of the command v", "m/s", 0.001, 2.0, 0.012, null=np.inf, logarithmic=True,
            trials=(0.004, 0.01, 0.025, 0.06), follows="position",
        ),
        Parameter("time_constant_s", "time constant τ", "s", 0.0, 0.5, 0.05, trials=(0.02, 0.06)),
    )  # fmt: skip
    contains = (Nested("rate_limit", at={"time_constant_s": 0.0}, same={"rate_m_s": "rate_m_s"}),)
    order = 4
    known_beforehand = ("",)

    def init(self, which: np.ndarray) -> State:
        return {"held": self.position[which]}

    def command(self, command: np.ndarray, fresh: np.ndarray) -> np.ndarray:
        held, most = self.state["held"], self["rate_m_s"] * self.dt
        weight = self.lag_weight("time_constant_s")
        followed = held + np.clip(weight * (command - held), -most, most)
        self.state["held"] = held = np.where(np.isinf(most) & (weight == 1), command, followed)
        return held
