"""The contact yields with time."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Effect, Parameter, first_order_weight
from forcegrasp.effects.touch import Touch


class ViscoelasticContact(Effect):
    """A Maxwell branch beside the elastic contact, which only pushes: a standard linear solid at the pad."""

    name = "viscoelastic_contact"
    stage = "contact"
    symptom = "force decays during a hold while the finger creeps inward; the peak depends on speed"
    formula = "F = F_contact + max(0, k (δ − x)), τ dx/dt = δ − x, δ the depth of the pad in the object"
    source = "standard linear solid, Zener's form (Fung 1965)"
    look_alikes = ("finger_compliance", "force_drift", "force_lag")
    separates = "long holds: force and position relax together, and only in contact"
    parameters = (
        Parameter(
            "stiffness_n_m", "stiffness k of the branch", "N/m", 0.0, 2000.0, 80.0, trials=(20.0, 80.0), follows="force"
        ),
        Parameter(
            "time_constant_s",
            "time constant τ",
            "s",
            0.03,
            20.0,
            0.5,
            null=0.5,
            logarithmic=True,
            trials=(0.1, 0.4, 1.5),
        ),
    )
    order = 1

    def start(self) -> None:
        self._touch, self._relaxed, self._push = Touch(len(self.values)), *np.zeros((2, len(self.values), 2))

    def reset(self, which: np.ndarray) -> None:
        self._touch.reset(which)
        self._relaxed[which] = self._push[which] = 0.0

    def act(self) -> None:
        depth = np.maximum(self._touch.depth(self.plant, self.rows, self.pad_force), 0.0)
        self._relaxed = self._relaxed + first_order_weight(self.dt, self["time_constant_s"]) * (depth - self._relaxed)
        self._push = self["stiffness_n_m"] * np.maximum(depth - self._relaxed, 0.0)
        self.plant.finger_push_n[self.rows] += self._push  # towards opening, away from the object
        self.plant.object_push_n[self.rows] += self._push[:, 0] - self._push[:, 1]

    def interaction(self, force: np.ndarray) -> np.ndarray:
        return force + self._push
