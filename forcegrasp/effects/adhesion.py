"""Pad and object stick together."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Contribution, Effect, Parameter, State
from forcegrasp.effects.touch import contact_push, depth_in_object, untouched


class Adhesion(Effect):
    """A pull between pad and object while they touch, which fades as they are torn apart."""

    name = "adhesion"
    stage = "contact"
    family = "contact"
    needs_object = True
    symptom = "negative force at light touches and at release; the pad lets go late"
    formula = "F = F_contact − F_a while in contact, −F_a max(0, 1 − gap / d) after it"
    source = "adhesive force with a tear-off distance; MuJoCo's `adhesion` has none and acts once per contact point"
    look_alikes = ("backlash", "force_deadzone", "force_bias")
    separates = "full releases, slow enough to be sampled"
    parameters = (
        Parameter("force_n", "adhesive force F_a", "N", 0.0, 0.5, 0.03, trials=(0.005, 0.02, 0.06), follows="force"),
        Parameter("distance_m", "tear-off distance d", "m", 0.0, 0.002, 2e-4, null=2e-4, trials=(2e-4,)),
    )
    order = 2

    def init(self, which: np.ndarray) -> State:
        return {"surface": untouched(which), "bonded": np.zeros((len(which), 2), bool)}

    def _pull(self, force: np.ndarray) -> np.ndarray:
        gap = np.maximum(-depth_in_object(self, force), 0.0)
        distance = np.maximum(self["distance_m"], 1e-9)
        self.state["bonded"] = bonded = (self.state["bonded"] | (force > 0)) & (gap < distance)
        return np.where(bonded, self["force_n"] * (1 - np.minimum(gap / distance, 1.0)), 0.0)

    def act(self) -> Contribution:
        return contact_push(-self._pull(self.pad_force))

    def interaction(self, force: np.ndarray) -> np.ndarray:
        return force - self._pull(force)
