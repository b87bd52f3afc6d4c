"""Dry friction that vanishes smoothly at rest."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Contribution, Effect, Nested, Parameter, State

#: Below this speed, m/s or rad/s, tanh(v / v_c) / v is 1 / v_c to the last digit for any v_c that is tried.
_REST = 1e-12


class SmoothFriction(Effect):
    """A force of constant size against fast motion, and in proportion to slow motion: under a load the joint creeps.

    Greased joints do so, and so do many simulators, in which friction that holds at rest is hard to write. The force is
    taken as a damping, implicitly, so that it is stable for any v_c; that of the speed which the last two steps lead to
    expect. At v_c = 0 it is Coulomb's friction.
    """

    name = "smooth_friction"
    stage = "actuator"
    family = "friction"
    symptom = "it lags as with dry friction while it moves, and then creeps to its command instead of stopping short"
    formula = "F = −F_c tanh(v / v_c)"
    source = "Andersson, Söderberg and Björklund (2007), smooth Coulomb friction"
    look_alikes = ("coulomb_friction", "presliding", "stiction", "viscoelastic_contact")
    separates = "long pauses in free air after a motion: it creeps on where dry friction rests"
    parameters = (
        Parameter("force_n", "friction F_c", "N", 0.0, 0.5, 0.03, trials=(0.02, 0.06), follows="effort"),
        Parameter(
            "creep_m_s", "speed v_c below which it falls", "m/s", 0.0, 0.02, 5e-4, null=5e-4, trials=(5e-4,),
            follows="position",
        ),
    )  # fmt: skip
    contains = (Nested("coulomb_friction", at={"creep_m_s": 0.0}, same={"force_n": "force_n"}),)
    order = 7

    def init(self, which: np.ndarray) -> State:
        return {"velocity": self.velocity[which]}

    def act(self) -> Contribution:
        force, creep, now = self["force_n"], self["creep_m_s"], self.velocity
        dry = creep == 0
        expected = 2 * now - self.state["velocity"]
        self.state["velocity"] = now
        speed = np.maximum(np.where(expected * now > 0, np.abs(expected), 0.0), _REST)
        damping = force * np.tanh(speed / np.where(dry, 1.0, creep)) / speed
        return Contribution(friction=np.where(dry, force, 0.0), damping=np.where(dry, 0.0, damping))
