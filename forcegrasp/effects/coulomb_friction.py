"""Dry friction in the finger's drive."""

from __future__ import annotations

from forcegrasp.effects.base import Contribution, Effect, Parameter


class CoulombFriction(Effect):
    """A force of constant size against the motion; at rest it holds up to that size."""

    name = "coulomb_friction"
    stage = "actuator"
    family = "friction"
    symptom = "the finger stops short of its command by an offset that flips with the direction"
    formula = "F = −F_c sign(v); |F| ≤ F_c at rest"
    source = "MuJoCo's `frictionloss`, with a stiff constraint lest it creeps"
    look_alikes = (
        "stiction",
        "backlash",
        "command_deadband",
        "motor_offset",
        "presliding",
        "smooth_friction",
        "load_friction",
        "position_deadband",
    )
    separates = "reversals in free air, where force and play take no part"
    parameters = (
        Parameter("force_n", "friction F_c", "N", 0.0, 0.5, 0.03, trials=(0.005, 0.02, 0.06), follows="effort"),
    )
    acts_alike = True

    def act(self) -> Contribution:
        return Contribution(friction=self["force_n"])
