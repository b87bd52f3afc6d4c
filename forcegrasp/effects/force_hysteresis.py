"""Loading and unloading read differently."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Effect, Parameter


class ForceHysteresis(Effect):
    """A sensor that reads more while the force falls than while it rises, at any speed.

    The width is the play of a constant size; the share makes the unloading curve a multiple of the loading curve.
    """

    name = "force_hysteresis"
    stage = "sensor"
    symptom = "loading and unloading curves differ, at any speed"
    formula = "f₁ ← clip(f₁, f − w/2, f + w/2); f' ← max(f₁, min(f', (1 + h) f₁))"
    source = "play and generalised play operators (Krasnosel'skii and Pokrovskii 1989)"
    look_alikes = ("backlash", "force_lag", "viscoelastic_contact")
    separates = "loading and unloading at several speeds: lag shrinks when slow, hysteresis does not"
    parameters = (
        Parameter("width_n", "width of the play w", "N", 0.0, 1.0, 0.04, follows="force"),
        Parameter("share", "excess while unloading h", "1", 0.0, 2.0, 0.15),
    )
    order = 1
    least_channels = 1

    @classmethod
    def trials(cls) -> np.ndarray:
        return np.array([[0.03, 0.0], [0.1, 0.0], [0.0, 0.1], [0.0, 0.3]])

    def start(self) -> None:
        self._play, self._read = np.zeros((2, len(self.values), self.channels))

    def reset(self, which: np.ndarray) -> None:
        self._play[which] = self._read[which] = 0

    def read_force(self, force: np.ndarray) -> np.ndarray:
        half, share = self["width_n"] / 2, self["share"]
        self._play = np.where(half == 0, force, np.clip(self._play, force - half, force + half))
        self._read = np.maximum(self._play, np.minimum(self._read, (1 + share) * self._play))
        return np.where(share == 0, self._play, self._read)
