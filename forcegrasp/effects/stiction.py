"""Dry friction that holds more firmly than it slides."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Contribution, Effect, Parameter

#: Velocity at which the finger no longer sticks, m/s (Stribeck velocity).
STRIBECK_M_S = 0.002


class Stiction(Effect):
    """Friction that falls from a breakaway force to a share of it once the finger slides (Stribeck curve)."""

    name = "stiction"
    stage = "actuator"
    symptom = "the finger sticks, then jumps; where it stops depends on how it came there"
    formula = "|F| ≤ F_s (r + (1 − r) exp(−(v / v_s)²)), v_s = 2 mm/s"
    source = "Armstrong-Hélouvry et al. (1994), Stribeck friction, on MuJoCo's `frictionloss`"
    look_alikes = ("coulomb_friction", "command_deadband", "backlash")
    separates = "slow ramps: stick and slip instead of steady sliding"
    parameters = (
        Parameter(
            "breakaway_n", "breakaway force F_s", "N", 0.0, 0.5, 0.05, trials=(0.02, 0.06, 0.15), follows="effort"
        ),
        Parameter("kinetic_share", "share r that is left while sliding", "1", 0.0, 1.0, 0.4, null=0.4, trials=(0.4,)),
    )
    order = 1

    def act(self) -> Contribution:
        share = self["kinetic_share"]
        stuck = np.exp(-((self.velocity / (STRIBECK_M_S * self.position_scale)) ** 2))
        return Contribution(friction=self["breakaway_n"] * (share + (1 - share) * stuck))
