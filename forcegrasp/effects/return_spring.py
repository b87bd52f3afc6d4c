"""A spring beside the motor."""

from __future__ import annotations

from forcegrasp.effects.base import Contribution, Effect, Parameter


class ReturnSpring(Effect):
    """A spring pulls each finger to one position: it opens or closes a gripper without power, or takes play out of it.

    Cables, hoses and bellows do as much.
    """

    name = "return_spring"
    stage = "actuator"
    family = "elasticity"
    symptom = "a motor rests off its command, the more the farther it is from one position"
    formula = "F' = F − k (q − q_0)"
    source = "MuJoCo's joint `stiffness` and `springref`, as of the Robotiq 2F-85 in MuJoCo Menagerie"
    look_alikes = ("motor_offset", "encoder_scale", "encoder_bias")
    separates = "stairs over the whole stroke in free air; a scale of the encoder leaves the effort as it is"
    parameters = (
        Parameter("stiffness_n_m", "stiffness k", "N/m", 0.0, 100.0, 5.0, trials=(3.0,), follows="damping"),
        Parameter(
            "rest_m", "position q_0 that it pulls to", "m", -0.1, 0.15, 0.045, null=0.045, trials=(0.0, 0.045),
            follows="position",
        ),
    )  # fmt: skip
    order = 13

    def act(self) -> Contribution:
        return Contribution(motor_push=self["stiffness_n_m"] * (self["rest_m"] - self.position))
