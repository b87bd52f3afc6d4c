"""A reading that turns round gradually where the force turns."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Effect, Parameter, State


class RoundedForceHysteresis(Effect):
    """Layers in a sensor, or beside it, that rub: the reading differs between loading and unloading, at any speed.

    After each reversal of the force the reading goes over from one curve to the other within about the range r, so that
    the loop of a large squeeze is as wide as 2 a and that of a small one narrower. Layers that carry part of the force
    past the sensor let it read less while the force rises: a < 0.
    ``lasting``: what rubs still shows once nothing presses. ``zeroed``: where nothing presses, nothing is read.
    """

    name = "rounded_force_hysteresis"
    stage = "sensor"
    family = "force sensor"
    symptom = "loading and unloading curves differ at any speed, by less the smaller the squeeze; each turn is rounded"
    formula = "f' = f + a s, ds/df = (sign(df) − s) sign(df) / r; 0 if f = 0 (zeroed)"
    source = "Dahl (1968), with the force in the place of the position"
    look_alikes = ("force_hysteresis", "force_lag", "viscoelastic_contact", "presliding")
    separates = "partial releases of several sizes: loops of small ones are narrow, where a play of one width is lost"
    parameters = (
        Parameter("excess_n", "what is read more while loading a", "N", -1.0, 1.0, -0.04, follows="force"),
        Parameter("range_n", "range of the turn r", "N", 0.01, 5.0, 0.2, null=0.2, logarithmic=True, follows="force"),
    )
    variants = ("lasting", "zeroed")
    variant_needs = {"zeroed": "pads"}  # noqa: RUF012 never changed
    order = -2  # it is in the way of the force, before what else is done to a reading
    least_channels = 1

    @classmethod
    def trials(cls) -> np.ndarray:
        return np.array([[-0.03, 0.1], [-0.03, 0.5]])

    def init(self, which: np.ndarray) -> State:
        force, side = np.zeros((2, len(which), self.channels))
        return {"force": force, "side": side}

    def read_force(self, force: np.ndarray) -> np.ndarray:
        state, change = self.state, force - self.state["force"]
        end = np.sign(change)
        state["side"] = end + (state["side"] - end) * np.exp(-np.abs(change) / self["range_n"])
        state["force"] = force.copy()
        reading = force + self["excess_n"] * state["side"]
        return np.where(force == 0, 0.0, reading) if self.variant == "zeroed" else reading
