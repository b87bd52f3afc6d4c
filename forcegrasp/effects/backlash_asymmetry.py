"""Lost motion between motor and pad that is larger in one finger."""

from __future__ import annotations

import dataclasses

import numpy as np

from forcegrasp.effects.backlash import Backlash
from forcegrasp.effects.base import Nested
from forcegrasp.effects.each_finger import SHARE, of_each


class BacklashAsymmetry(Backlash):
    """Lost motion of which each finger has its own: one gear is more worn than the other.

    At a = 1 only the left finger has any, at a = −1 only the right one, and at a = 0 both alike. ``play``, ``loose``,
    ``command``: as those of `backlash`.
    """

    name = "backlash_asymmetry"
    least_motors = 2
    symptom = "motion is lost after each reversal, more of it in one finger; that one touches later and lets go later"
    formula = "p ← clip(p, m − g/2, m + g/2), g_l = (1 + a) g, g_r = (1 − a) g"
    look_alikes = ("backlash", "encoder_bias", "friction_asymmetry", "force_deadzone")
    separates = "pauses, reversals and partial releases in contact, of either finger"
    parameters = (
        dataclasses.replace(Backlash.parameters[0], doc="mean lost motion g of both", trials=(3e-4, 1e-3)),
        SHARE,
    )
    contains = (Nested("backlash", at={"share": 0.0}, same={"gap_m": "gap_m"}),)
    order = 4

    @property
    def gap(self) -> np.ndarray:
        return of_each(self, "gap_m")
