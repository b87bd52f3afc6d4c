"""Forces are read through a low-pass filter."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Effect, Parameter, State, first_order_weight


class ForceLag(Effect):
    """A first-order filter in the force sensor."""

    name = "force_lag"
    stage = "sensor"
    family = "force sensor"
    symptom = "force is smoothed, position is not"
    formula = "τ df'/dt = f − f'"
    source = "first-order low-pass filter, at the physics rate"
    look_alikes = ("force_delay", "viscoelastic_contact")
    separates = "fast steps and first contact: a lagged force has no corner"
    parameters = (Parameter("time_constant_s", "time constant τ", "s", 0.0, 1.0, 0.08, trials=(0.01, 0.03, 0.1, 0.3)),)
    order = 3
    least_channels = 1

    def init(self, which: np.ndarray) -> State:
        return {"held": np.full((len(which), self.channels), np.nan)}  # the first force that comes

    def read_force(self, force: np.ndarray) -> np.ndarray:
        held = np.where(np.isnan(self.state["held"]), force, self.state["held"])
        weight = first_order_weight(self.dt, self["time_constant_s"])
        self.state["held"] = held = np.where(weight == 1, force, held + weight * (force - held))
        return held
