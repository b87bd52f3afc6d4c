"""The finger gives way under load."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Contribution, Effect, Parameter, State

#: Time in which the spring settles, s: far below what 25 Hz can see, far above a physics step.
SETTLING_S = 0.008


class FingerCompliance(Effect):
    """A spring between the motor, where the encoder sits, and the pad."""

    name = "finger_compliance"
    stage = "transmission"
    family = "elasticity"
    needs_object = True
    symptom = "the encoder runs ahead of the pad by an amount that grows with the force"
    formula = "p = m + c F_pad"
    source = "series elasticity (Pratt and Williamson 1995), quasi-static"
    look_alikes = ("finger_creep", "stiffening_contact", "viscoelastic_contact", "encoder_bias")
    separates = (
        "objects whose stiffness is known, or far above the finger's: stiffnesses that are fitted object by object take"
        " up a spring that is alike on both sides"
    )
    parameters = (
        Parameter(
            "compliance_m_n",
            "deflection per force c",
            "m/N",
            0.0,
            0.02,
            0.001,
            trials=(3e-4, 1e-3, 3e-3),
            follows="compliance",
        ),
    )
    order = 1

    def init(self, which: np.ndarray) -> State:
        return {"deflection": np.zeros((len(which), 2))}

    @property
    def compliance(self) -> np.ndarray:
        """Deflection per force, m/N, broadcast with ``(rows, 2)``."""
        return self["compliance_m_n"]

    def act(self) -> Contribution:
        before = self.state["deflection"]
        gap = self.compliance * self.plant.press_n[self.at] - before
        self.state["deflection"] = deflection = before + self.lag_weight(SETTLING_S) * gap
        return Contribution(pad_shift_m=deflection)
