"""Force readings wander off with time."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Effect, Parameter, State


class ForceDrift(Effect):
    """An offset of each force sensor that grows from the start of the grasp."""

    name = "force_drift"
    stage = "sensor"
    family = "force sensor"
    symptom = "force in free air and in holds has a slope"
    formula = "f' = f + s t, per finger"
    source = "thermal drift of strain gauges"
    look_alikes = ("force_bias", "viscoelastic_contact")
    separates = "free motion after a long hold: drift stays, relaxation does not"
    parameters = (
        Parameter("left_n_s", "slope of the left sensor", "N/s", -1.0, 1.0, 0.02, follows="force"),
        Parameter("right_n_s", "slope of the right sensor", "N/s", -1.0, 1.0, -0.015, follows="force"),
    )
    order = 7
    per, alone = "channel", "slope"
    least_channels = 1

    @classmethod
    def trials(cls) -> np.ndarray:
        return np.array([[0.02, 0.0], [0.0, 0.02]])

    def init(self, which: np.ndarray) -> State:
        return {"time": np.full((len(which), 1), -self.dt)}  # so that the first reading is at 0

    def read_force(self, force: np.ndarray) -> np.ndarray:
        self.state["time"] += self.dt
        return force + self.values * self.state["time"]
