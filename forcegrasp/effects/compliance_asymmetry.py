"""One finger gives way under load more than the other."""

from __future__ import annotations

import dataclasses

import numpy as np

from forcegrasp.effects.base import Nested
from forcegrasp.effects.each_finger import SHARE, of_each
from forcegrasp.effects.finger_compliance import FingerCompliance


class ComplianceAsymmetry(FingerCompliance):
    """A spring between each motor and its pad, softer in one finger: another pad, or a longer fingertip.

    At a = 1 the left finger alone gives way, at a = −1 the right one, and at a = 0 both do alike.
    """

    name = "compliance_asymmetry"
    least_motors = 2
    symptom = "each encoder runs ahead of its pad by an amount that grows with the force, one of them further"
    formula = "p_l = m_l + (1 + a) c F_l, p_r = m_r + (1 − a) c F_r"
    look_alikes = ("finger_compliance", "force_gain_asymmetry", "motor_asymmetry", "encoder_bias")
    separates = "squeezes of an object that stands still between the fingers, to several forces"
    parameters = (
        dataclasses.replace(
            FingerCompliance.parameters[0], doc="mean deflection per force c of both", trials=(3e-4, 1e-3)
        ),
        SHARE,
    )
    contains = (Nested("finger_compliance", at={"share": 0.0}, same={"compliance_m_n": "compliance_m_n"}),)
    order = 5

    @property
    def compliance(self) -> np.ndarray:
        return of_each(self, "compliance_m_n")
