"""Dry friction that vanishes smoothly at rest."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Nested, Parameter
from forcegrasp.effects.creeping_friction import CREEP, CreepingFriction


class SmoothFriction(CreepingFriction):
    """A force of constant size against fast motion, and in proportion to slow motion: under a load the joint creeps.

    Greased joints do so, and so do many simulators, in which friction that holds at rest is hard to write.
    """

    name = "smooth_friction"
    symptom = "it lags as with dry friction while it moves, and then creeps to its command instead of stopping short"
    formula = "F = −F_c tanh(v / v_c)"
    source = "Andersson, Söderberg and Björklund (2007), smooth Coulomb friction"
    look_alikes = ("coulomb_friction", "presliding", "stiction", "viscous_friction", "viscoelastic_contact")
    separates = "long pauses in free air after a motion: it creeps on where dry friction rests"
    parameters = (
        Parameter("force_n", "friction F_c", "N", 0.0, 0.5, 0.03, trials=(0.02, 0.06), follows="effort"),
        CREEP,
    )
    contains = (Nested("coulomb_friction", at={"creep_m_s": 0.0}, same={"force_n": "force_n"}),)
    order = 7

    def level(self) -> np.ndarray:
        return self["force_n"]
