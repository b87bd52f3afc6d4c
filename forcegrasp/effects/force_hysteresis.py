"""Loading and unloading read differently."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Effect, Parameter, State


class ForceHysteresis(Effect):
    """A sensor that reads more while the force falls than while it rises, at any speed.

    The width is the play of a constant size; the share makes the unloading curve a multiple of the loading curve.
    ``lasting``: half the width is still read once nothing presses. ``zeroed``: where nothing presses, nothing is read,
    and at the next touch the reading is back where it was.
    """

    name = "force_hysteresis"
    stage = "sensor"
    family = "force sensor"
    symptom = "loading and unloading curves differ, at any speed"
    formula = "f₁ ← clip(f₁, f − w/2, f + w/2); f' ← max(f₁, min(f', (1 + h) f₁)); 0 if f = 0 (zeroed)"
    source = "play and generalised play operators (Krasnosel'skii and Pokrovskii 1989)"
    look_alikes = ("rounded_force_hysteresis", "backlash", "force_lag", "viscoelastic_contact")
    separates = "loading and unloading at several speeds: lag shrinks when slow, hysteresis does not"
    parameters = (
        Parameter("width_n", "width of the play w", "N", 0.0, 1.0, 0.04, follows="force"),
        Parameter("share", "excess while unloading h", "1", 0.0, 2.0, 0.15),
    )
    variants = ("lasting", "zeroed")
    variant_needs = {"zeroed": "pads"}  # noqa: RUF012 never changed
    order = 1
    least_channels = 1

    @classmethod
    def trials(cls) -> np.ndarray:
        return np.array([[0.03, 0.0], [0.1, 0.0], [0.0, 0.1], [0.0, 0.3]])

    def init(self, which: np.ndarray) -> State:
        play, read = np.zeros((2, len(which), self.channels))
        return {"play": play, "read": read}

    def read_force(self, force: np.ndarray) -> np.ndarray:
        state, half, share = self.state, self["width_n"] / 2, self["share"]
        state["play"] = play = np.where(half == 0, force, np.clip(state["play"], force - half, force + half))
        state["read"] = read = np.maximum(play, np.minimum(state["read"], (1 + share) * play))
        reading = np.where(share == 0, play, read)
        return np.where(force == 0, 0.0, reading) if self.variant == "zeroed" else reading
