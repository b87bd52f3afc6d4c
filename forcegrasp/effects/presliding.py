"""Dry friction that gives way elastically before it slides."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Contribution, Effect, Nested, Parameter, State

#: Damping of the bristles, as a time in which they settle, s; far below what is read, LuGre's σ1 ÷ σ0.
SETTLING_S = 0.004


class Presliding(Effect):
    """Friction by bristles that bend before they slip (Dahl; LuGre without its Stribeck curve).

    After each reversal the force changes over a displacement of about z_c instead of at once, and a joint that is held
    springs back a little when it is let go. The bristles' bend follows exactly from each step's motion; their force on
    the coming step is taken implicitly, so that bristles of any stiffness are stable. At z_c = 0 it is Coulomb's.
    """

    name = "presliding"
    stage = "actuator"
    family = "friction"
    symptom = "like dry friction, but rounded: after a reversal it grows over a small displacement, as a spring would"
    formula = "F = −F_c (z + τ dz/dt) / z_c, dz/dt = v − |v| z / z_c, τ = 4 ms"
    source = "Dahl (1968); Canudas de Wit et al. (1995), LuGre"
    look_alikes = ("coulomb_friction", "smooth_friction", "stiction", "backlash", "elastic_transmission")
    separates = "small reversals: within z_c the joint moves a little for each push, where Coulomb's friction holds it"
    parameters = (
        Parameter("force_n", "friction F_c", "N", 0.0, 0.5, 0.03, trials=(0.02, 0.06), follows="effort"),
        Parameter(
            "displacement_m", "presliding displacement z_c", "m", 0.0, 0.002, 2e-4, null=2e-4, trials=(2e-4,),
            follows="position",
        ),
    )  # fmt: skip
    contains = (Nested("coulomb_friction", at={"displacement_m": 0.0}, same={"force_n": "force_n"}),)
    order = 5
    follows_motion = True

    def init(self, which: np.ndarray) -> State:
        position = self.position[which]
        return {"position": position, "bend": np.zeros_like(position)}

    def act(self) -> Contribution:
        force, slip, state = self["force_n"], self["displacement_m"], self.state
        rigid = slip == 0
        slip = np.where(rigid, 1.0, slip)
        moved = self.position - state["position"]
        end = np.sign(moved) * slip  # where the bend would be after a long way
        bend = end + (state["bend"] - end) * np.exp(-np.abs(moved) / slip)
        self.state["position"], self.state["bend"] = self.position, np.where(moved == 0, state["bend"], bend)
        bend, stiffness = self.state["bend"], np.where(rigid, 0.0, force / slip)
        still_bends = 1 - np.sign(self.velocity) * bend / slip
        return Contribution(
            friction=np.where(rigid, force, 0.0),
            motor_push=-stiffness * bend,
            damping=stiffness * (self.dt + SETTLING_S) * still_bends,
        )
