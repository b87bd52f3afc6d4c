"""The actuator follows its command as a damped mass on a spring does: late, and with overshoot."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Effect, Nested, Parameter, State
from forcegrasp.effects.low_pass import second_order_low_pass


class SecondOrderLag(Effect):
    """A servo's own loop, or a filter of its set points, whose response is of second order.

    Its natural frequency is 1/(2π √(τ T)), its damping ratio √(τ / T) / 2. With T above τ / 4 it overshoots, below that
    it is two lags of first order in a row, and with T = 0 one.
    """

    name = "second_order_lag"
    stage = "actuator"
    family = "delay"
    symptom = "steps in the command arrive late and rounded, and overshoot, in free air too"
    formula = "τ (T d²u'/dt² + du'/dt) = u − u'"
    source = "closed loop of a position servo of limited bandwidth, as control textbooks have it (Franklin et al.)"
    look_alikes = ("actuator_lag", "command_delay", "rate_limited_lag", "velocity_lag", "elastic_transmission")
    separates = "fast steps in free air: a lag of first order starts at its largest speed, and never overshoots"
    parameters = (
        Parameter("time_constant_s", "time constant τ", "s", 0.0, 0.5, 0.04, trials=(0.01, 0.03, 0.09)),
        Parameter(
            "inertia_s", "time constant of its speed T, inertia ÷ damping", "s", 0.0, 0.5, 0.04, null=0.04,
            trials=(0.005, 0.02, 0.06),
        ),
    )  # fmt: skip
    contains = (Nested("actuator_lag", at={"inertia_s": 0.0}, same={"time_constant_s": "time_constant_s"}),)
    order = 1
    known_beforehand = ("",)

    def init(self, which: np.ndarray) -> State:
        held = self.resting_command[which]
        return {"held": held, "rate": np.zeros_like(held)}

    def command(self, command: np.ndarray, fresh: np.ndarray) -> np.ndarray:
        tau = self["time_constant_s"]
        ringing = np.sqrt(tau * self["inertia_s"])
        self.state["held"] = held = second_order_low_pass(self, command, self.state["held"], tau, ringing)
        return held
