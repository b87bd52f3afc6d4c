"""Forces are read through a low-pass filter."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Effect, Parameter, State
from forcegrasp.effects.low_pass import ORDERS, low_pass


class ForceLag(Effect):
    """A filter in the force sensor, of first order unless it is said.

    ``butterworth``: one of second order with the same corner frequency 1/(2πτ), as amplifiers and drivers have.
    """

    name = "force_lag"
    stage = "sensor"
    family = "force sensor"
    symptom = "force is smoothed, position is not"
    formula = "τ df'/dt = f − f'; τ² d²f'/dt² + √2 τ df'/dt = f − f' (butterworth)"
    source = "low-pass filters, at the physics rate; Butterworth 1930"
    look_alikes = ("force_delay", "viscoelastic_contact")
    separates = "fast steps and first contact: a lagged force has no corner"
    parameters = (Parameter("time_constant_s", "time constant τ", "s", 0.0, 1.0, 0.08, trials=(0.01, 0.03, 0.1, 0.3)),)
    variants = ORDERS
    order = 3
    least_channels = 1

    def init(self, which: np.ndarray) -> State:
        shape = len(which), self.channels
        return {"held": np.full(shape, np.nan), "rate": np.zeros(shape)}  # at rest at the first force that comes

    def read_force(self, force: np.ndarray) -> np.ndarray:
        held = np.where(np.isnan(self.state["held"]), force, self.state["held"])
        self.state["held"] = held = low_pass(self, force, held)
        return held
