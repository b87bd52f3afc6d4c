"""Light touches are not read."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Effect, Parameter


class ForceDeadzone(Effect):
    """Forces below a threshold read as zero.

    ``subtract``: what is above it reads from zero on, as with a preload. ``gate``: what is above it reads in full.
    """

    name = "force_deadzone"
    stage = "sensor"
    family = "force sensor"
    symptom = "force stays 0 at a light touch"
    formula = "f' = sign(f) max(|f| − z, 0) (subtract), or f if |f| ≥ z else 0 (gate)"
    source = "preloaded tactile skins, thresholded drivers"
    look_alikes = ("backlash", "adhesion", "deadzone_asymmetry")
    separates = "partial releases: the zone is crossed at one force, a gap at one travel"
    parameters = (
        Parameter(
            "threshold_n", "threshold z", "N", 0.0, 2.0, 0.08, trials=(0.02, 0.05, 0.1, 0.2, 0.4), follows="force"
        ),
    )
    variants = ("subtract", "gate")
    order = 5
    least_channels = 1

    @property
    def threshold(self) -> np.ndarray:
        """Of each channel, or of all alike, newtons, ``(rows, channels)`` or ``(rows, 1)``."""
        return self["threshold_n"]

    def read_force(self, force: np.ndarray) -> np.ndarray:
        threshold = self.threshold
        if self.variant == "gate":
            return np.where(np.abs(force) < threshold, 0.0, force)
        return np.where(threshold == 0, force, np.sign(force) * np.maximum(np.abs(force) - threshold, 0.0))
