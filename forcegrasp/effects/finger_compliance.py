"""The finger gives way under load."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Effect, Parameter, first_order_weight

#: Time in which the spring settles, s: far below what 25 Hz can see, far above a physics step.
SETTLING_S = 0.008


class FingerCompliance(Effect):
    """A spring between the motor, where the encoder sits, and the pad."""

    name = "finger_compliance"
    stage = "transmission"
    symptom = "the encoder runs ahead of the pad by an amount that grows with the force"
    formula = "p = m + c F_pad"
    source = "series elasticity (Pratt and Williamson 1995), quasi-static"
    look_alikes = ("stiffening_contact", "viscoelastic_contact", "encoder_bias")
    separates = "objects of several softnesses: the finger's deflection is the same for all at one force"
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

    def start(self) -> None:
        self._deflection = np.zeros((len(self.values), 2))

    def reset(self, which: np.ndarray) -> None:
        self._deflection[which] = 0

    def act(self) -> None:
        gap = self["compliance_m_n"] * self.pad_force - self._deflection
        self._deflection = self._deflection + first_order_weight(self.dt, SETTLING_S) * gap
        self.plant.pad_shift_m[self.rows] += self._deflection
