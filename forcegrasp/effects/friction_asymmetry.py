"""Dry friction that is larger in one finger's drive than in the other's."""

from __future__ import annotations

from forcegrasp.effects.base import Contribution, Effect, Nested, Parameter
from forcegrasp.effects.each_finger import SHARE, of_each


class FrictionAsymmetry(Effect):
    """Dry friction of which each finger has its own share: one gear is worn, one guide runs dry, one cable drags.

    At a = 1 the left finger alone rubs, at a = −1 the right one, and at a = 0 both rub alike, as with Coulomb's.
    """

    name = "friction_asymmetry"
    stage = "actuator"
    family = "friction"
    least_motors = 2
    symptom = "one finger stops farther short of its command than the other, by offsets that flip with the direction"
    formula = "F_l = −(1 + a) F_c sign(v_l), F_r = −(1 − a) F_c sign(v_r); up to as much at rest"
    source = "MuJoCo's `frictionloss` of each joint, with a stiff constraint lest it creeps"
    look_alikes = ("coulomb_friction", "presliding", "stiction", "smooth_friction", "motor_asymmetry", "motor_offset")
    separates = "reversals of each finger in free air: servos of unlike gains lag by what grows with the speed"
    parameters = (
        Parameter("force_n", "mean friction F_c of both", "N", 0.0, 0.5, 0.03, trials=(0.02, 0.06), follows="effort"),
        SHARE,
    )
    contains = (Nested("coulomb_friction", at={"share": 0.0}, same={"force_n": "force_n"}),)
    order = 14
    acts_alike = True

    def act(self) -> Contribution:
        return Contribution(friction=of_each(self, "force_n"))
