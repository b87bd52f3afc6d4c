"""Something pulls at the object besides the fingers."""

from __future__ import annotations

from forcegrasp.effects.base import Contribution, Effect, Parameter


class ObjectPull(Effect):
    """A constant force on the object along the grasp axis: gravity on a tilted gripper, a hose, a table that slopes.

    What it stands on holds against it as far as its friction goes. Gravity pulls at the fingers, too (`motor_offset`).
    """

    name = "object_pull"
    stage = "object"
    family = "offset"
    needs_object = True
    symptom = "one finger is pressed harder than the other, by the same force however hard both press"
    formula = "m a = f_l − f_r + F_0 + friction; positive towards the right finger"
    source = "Newton's second law; F_0 = m g sin θ where the grasp axis is tilted by θ"
    look_alikes = ("force_bias", "force_gain_asymmetry", "object_friction", "motor_offset", "force_crosstalk")
    separates = (
        "light and hard squeezes: sensors' gains differ in proportion; sensors that are off are so in free air, too"
    )
    parameters = (Parameter("force_n", "force F_0", "N", -20.0, 20.0, 0.03, trials=(0.03,), follows="force"),)
    order = 4
    acts_alike = True

    def act(self) -> Contribution:
        return Contribution(object_push_n=self["force_n"][:, 0])
