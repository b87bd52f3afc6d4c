"""Pad and object stick together."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Effect, Parameter


class Adhesion(Effect):
    """A pull between pad and object for as long as they touch."""

    name = "adhesion"
    stage = "contact"
    symptom = "negative force at release; the pad lets go late"
    formula = "F = F_contact − F_a while in contact"
    source = "constant adhesive force; MuJoCo's `adhesion` does it once per contact point"
    look_alikes = ("backlash", "force_deadzone", "force_bias")
    separates = "full releases, slow enough to be sampled"
    parameters = (Parameter("force_n", "adhesive force F_a", "N", 0.0, 0.5, 0.03, trials=(0.005, 0.02, 0.06)),)
    order = 2

    def _pull(self, force: np.ndarray) -> np.ndarray:
        return np.where(force > 0, self["force_n"], 0.0)

    def act(self) -> None:
        pull = self._pull(self.pad_force)
        self.plant.finger_push_n[self.rows] -= pull  # towards closing, onto the object
        self.plant.object_push_n[self.rows] += pull[:, 1] - pull[:, 0]  # the right finger stands on its positive side

    def interaction(self, force: np.ndarray) -> np.ndarray:
        return force - self._pull(force)
