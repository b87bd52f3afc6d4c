"""Dry friction that grows with the load of the gears."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Contribution, Effect, Parameter, State

#: Friction by the load.
COEFFICIENT = Parameter("coefficient", "friction per load c", "1", 0.0, 0.6, 0.15, trials=(0.1,))


#: What the load is: what both ends of the transmission carry, what presses alone, or what the motor puts in.
LOADS = ("carried", "pressed", "driven")
#: Where nothing is grasped, all that acts from outside is a load that the transmission carries.
LOADS_NEED = {"pressed": "pads"}


def load_of(effect: Effect) -> np.ndarray:
    """What loads the transmission, N or N·m, ``(rows, motors)``; it remembers the last velocity."""
    plant, rows = effect.plant, effect.rows
    if effect.variant == "pressed":
        return np.abs(plant.outside_force[rows])
    if effect.variant == "driven":
        acceleration = (effect.velocity - effect.state["velocity"]) / effect.dt
        return np.abs(plant.motor_force[rows] - plant.rotor_inertia[rows] * acceleration)
    return np.abs(plant.motor_force[rows] - plant.outside_force[rows])


class LoadFriction(Effect):
    """Gears that are pressed together rub: dry friction in proportion to their load.

    ``carried``: what the motor gives against what acts on the joint from outside (gravity, springs, a load, fingertips
    that press). At rest the two are opposite, and both count, so that friction is 2 c times the load that is held.
    ``pressed``: what acts from outside alone, as in a screw or a guide that turns freely until fingertips press.
    ``driven``: what the motor puts in, less what speeds up its own rotor (MuJoCo's armature): what the teeth of a gear
    behind the rotor pass on.
    """

    name = "load_friction"
    stage = "actuator"
    family = "friction"
    symptom = "force is lost while squeezing and held while easing; the offset that flips grows with the load"
    formula = "|F| ≤ c |F_motor − F_outside| (carried), c |F_outside| (pressed), c |F_motor − J_rotor d²q/dt²| (driven)"
    source = "carried: Duclusaud et al. (2024), arXiv 2410.08650, model M3, forces of the last physics step"
    look_alikes = ("coulomb_friction", "stiction", "force_hysteresis", "backlash")
    separates = "holds that are approached from both sides under several loads: the band is as wide as the load is high"
    parameters = (COEFFICIENT,)
    variants = LOADS
    variant_needs = LOADS_NEED
    order = 4

    def init(self, which: np.ndarray) -> State:
        return {"velocity": self.velocity[which]}

    def act(self) -> Contribution:
        friction = self["coefficient"] * load_of(self)
        self.state["velocity"] = self.velocity
        return Contribution(friction=friction)
