"""Dry friction that holds more firmly than it slides."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Contribution, Effect, Nested, Parameter

#: The Stribeck curve.
STRIBECK = (
    Parameter("breakaway_n", "breakaway force F_s", "N", 0.0, 0.5, 0.05, trials=(0.02, 0.06, 0.15), follows="effort"),
    Parameter("kinetic_share", "share r that is left while sliding", "1", 0.0, 1.0, 0.4, null=0.4, trials=(0.4,)),
    Parameter(
        "stribeck_m_s",
        "Stribeck velocity v_s, at which it no longer sticks",
        "m/s",
        2e-4,
        0.1,
        0.002,
        null=0.002,
        logarithmic=True,
        trials=(0.002,),
        follows="position",
        if_missing=0.002,
    ),
)


def stribeck_level(effect: Effect) -> np.ndarray:
    """Friction at the speed that a motor has, N or N·m, ``(rows, motors)``."""
    share = effect["kinetic_share"]
    stuck = np.exp(-((effect.velocity / effect["stribeck_m_s"]) ** 2))
    return effect["breakaway_n"] * (share + (1 - share) * stuck)


class Stiction(Effect):
    """Friction that falls from a breakaway force to a share of it once the finger slides (Stribeck curve)."""

    name = "stiction"
    stage = "actuator"
    family = "friction"
    symptom = "the finger sticks, then jumps; where it stops depends on how it came there"
    formula = "|F| ≤ F_s (r + (1 − r) exp(−(v / v_s)²))"
    source = "Armstrong-Hélouvry et al. (1994), Stribeck friction, on MuJoCo's `frictionloss`"
    look_alikes = ("coulomb_friction", "command_deadband", "backlash", "presliding")
    separates = "slow ramps: stick and slip instead of steady sliding; speeds around v_s tell how fast friction falls"
    parameters = STRIBECK
    contains = (Nested("coulomb_friction", at={"kinetic_share": 1.0}, same={"breakaway_n": "force_n"}),)
    order = 1

    def act(self) -> Contribution:
        return Contribution(friction=stribeck_level(self))
