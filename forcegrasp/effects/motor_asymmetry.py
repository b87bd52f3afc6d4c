"""One finger's servo is stiffer than the other's, or more damped."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Contribution, Effect, Parameter, State
from forcegrasp.effects.each_finger import SIDES
from forcegrasp.physics.plant import Plant


class MotorAsymmetry(Effect):
    """The left servo pulls harder and the right one less by the same share, and so what damps their motion.

    A weaker motor or supply, a worn gear, or gains that were tuned for one side. What both have in common is in the
    gains of the base model.
    """

    name = "motor_asymmetry"
    stage = "actuator"
    family = "drive gain"
    needs_position_loop = True
    least_motors = 2
    symptom = "in free air one finger lags more than the other; between them the object goes to the weaker side"
    formula = "K_l = (1 + a) K, K_r = (1 − a) K; B_l = (1 + b) B, B_r = (1 − b) B, B all viscous damping of a finger"
    source = "tolerance of motors and gears"
    look_alikes = ("motor_offset", "coulomb_friction", "friction_asymmetry", "force_gain_asymmetry")
    separates = "ramps in both directions at several speeds: an offset does not grow with the speed, a gain's lag does"
    parameters = (
        Parameter("stiffness_share", "share a of the stiffness", "1", -0.5, 0.5, 0.1),
        Parameter("damping_share", "share b of the damping", "1", -0.5, 0.5, 0.1),
    )
    order = 8
    acts_alike = True

    @classmethod
    def trials(cls) -> np.ndarray:
        return np.array([[0.05, 0.0], [0.0, 0.05]])

    def change_model(self, plant: Plant, which: np.ndarray) -> None:
        rows = self.rows[which]
        for actuator, side in zip(plant.actuators, SIDES, strict=True):
            stiffer = 1 + side * self["stiffness_share"][which, 0]
            plant.field("actuator_gainprm")[rows, actuator, 0] *= stiffer
            plant.field("actuator_biasprm")[rows, actuator, 1] *= stiffer

    def init(self, which: np.ndarray) -> State:
        plant, rows = self.plant, self.rows[which, None]
        of_servo = -plant.field("actuator_biasprm")[rows, plant.actuators, 2]
        of_joint = plant.base("dof_damping")[rows, plant.motor_dofs]
        return {"damping": self["damping_share"][which] * SIDES * (of_servo + of_joint)}

    def act(self) -> Contribution:
        return Contribution(damping=self.state["damping"])
