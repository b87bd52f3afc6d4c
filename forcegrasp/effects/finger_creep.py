"""The finger gives way under load, and further with time."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Contribution, Effect, Nested, Parameter, State
from forcegrasp.effects.finger_compliance import SETTLING_S


class FingerCreep(Effect):
    """A spring between motor and pad, and in series with it one that a damper slows: a standard linear solid.

    At s = 0 all of it is slow (Kelvin and Voigt's solid, as rubber fingers are), at s = 1 nothing is, which is the
    spring of `finger_compliance`.
    """

    name = "finger_creep"
    stage = "transmission"
    family = "elasticity"
    needs_object = True
    symptom = "at one command the force falls with time and the motor closes further, on hard objects as on soft ones"
    formula = "p = m + s c F_pad + x, τ dx/dt = (1 − s) c F_pad − x"
    source = "standard linear solid, Kelvin's form (Fung 1965), in series with the motor"
    look_alikes = ("finger_compliance", "viscoelastic_contact", "force_drift", "smooth_friction")
    separates = (
        "long holds of objects of several softnesses, and long pauses after a release: the finger comes back slowly"
    )
    parameters = (
        Parameter(
            "compliance_m_n",
            "deflection per force c, in the end",
            "m/N",
            0.0,
            0.02,
            0.001,
            trials=(5e-4, 2e-3),
            follows="compliance",
        ),
        Parameter("at_once_share", "share s of it that comes at once", "1", 0.0, 1.0, 0.3, null=0.3, trials=(0.0, 0.5)),
        Parameter(
            "time_constant_s",
            "time constant τ of the rest",
            "s",
            0.02,
            20.0,
            0.4,
            null=0.4,
            logarithmic=True,
            trials=(0.1, 0.4, 1.5),
        ),
    )
    contains = (Nested("finger_compliance", at={"at_once_share": 1.0}, same={"compliance_m_n": "compliance_m_n"}),)
    order = 3

    def init(self, which: np.ndarray) -> State:
        return {"at_once": np.zeros((len(which), 2)), "creep": np.zeros((len(which), 2))}

    def act(self) -> Contribution:
        state, share = self.state, self["at_once_share"]
        to_come = self["compliance_m_n"] * self.plant.press_n[self.at]
        for part, target, lag in (
            ("at_once", share * to_come, SETTLING_S),
            ("creep", (1 - share) * to_come, "time_constant_s"),
        ):
            state[part] = state[part] + self.lag_weight(lag) * (target - state[part])
        return Contribution(pad_shift_m=state["at_once"] + state["creep"])
