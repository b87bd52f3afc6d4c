"""Friction that falls once the finger slides, and vanishes smoothly at rest."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Nested
from forcegrasp.effects.creeping_friction import CREEP, CreepingFriction
from forcegrasp.effects.stiction import STRIBECK, stribeck_level


class SmoothStiction(CreepingFriction):
    """The Stribeck curve with a slope at rest: friction grows with slow motion and falls again with fast motion."""

    name = "smooth_stiction"
    symptom = "it creeps to its command, and is held back less the faster it slides"
    formula = "F = −F_s (r + (1 − r) exp(−(v / v_s)²)) tanh(v / v_c)"
    source = "Armstrong-Hélouvry et al. (1994), Stribeck friction; Andersson et al. (2007), its smooth form"
    look_alikes = ("smooth_friction", "stiction", "presliding", "coulomb_friction")
    separates = "ramps at several speeds around v_s, with long pauses in free air after them"
    parameters = (*STRIBECK, CREEP)
    contains = (
        Nested("smooth_friction", at={"kinetic_share": 1.0}, same={"breakaway_n": "force_n", "creep_m_s": "creep_m_s"}),
        Nested("stiction", at={"creep_m_s": 0.0}, same={p.name: p.name for p in STRIBECK}),
        Nested("coulomb_friction", at={"kinetic_share": 1.0, "creep_m_s": 0.0}, same={"breakaway_n": "force_n"}),
    )
    order = 12

    def level(self) -> np.ndarray:
        return stribeck_level(self)
