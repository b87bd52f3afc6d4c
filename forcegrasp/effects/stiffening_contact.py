"""The contact grows stiffer the more it is squeezed, or less than in the scene."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Contribution, Effect, Parameter, State
from forcegrasp.effects.touch import contact_push, depth_in_object, untouched
from forcegrasp.physics.plant import Plant

#: Depth at which the spring's force is given, metres.
DEPTH_M = 0.001


class StiffeningContact(Effect):
    """A steeper or flatter impedance curve of the object's contact, or a spring beside it with a power of the depth.

    Power 1 is an elastic layer, 1.5 a round body (Hertz), 3 what hardens as foam does.
    """

    name = "stiffening_contact"
    stage = "contact"
    family = "contact"
    needs_object = True
    symptom = "the curve of force over squeeze is more convex than modelled, or less"
    formula = "d(r) with power p + Δp instead of p (MuJoCo's solimp), and F = F_contact + F₁ (δ / 1 mm)^q"
    source = "MuJoCo's `solimp`, last number; q is 1.5 of round bodies (Hertz 1882), 3 of Duffing's hardening spring"
    look_alikes = ("hunt_crossley_contact", "finger_compliance", "viscoelastic_contact")
    separates = "slow ramps to high force on soft objects"
    parameters = (
        Parameter("extra_power", "Δp, added to the scene's power", "1", -1.0, 8.0, 1.5),
        Parameter("spring_n", "force F₁ of the spring at a depth δ of 1 mm", "N", 0.0, 5.0, 0.05, follows="force"),
        Parameter("spring_power", "power q of the spring", "1", 1.0, 6.0, 3.0, null=3.0, if_missing=3.0),
    )

    @classmethod
    def trials(cls) -> np.ndarray:
        curves = [[extra, 0.0, 3.0] for extra in (0.5, 2.0, 5.0)]
        return np.array([*curves, *([0.0, force, power] for power in (1.0, 3.0) for force in (0.01, 0.04, 0.15))])

    def init(self, which: np.ndarray) -> State:
        # no motor can press harder; a long time step that overshoots must not be thrown back with more
        strongest = self.plant.strongest_press(self.rows[which])
        return {"surface": untouched(which), "push": np.zeros((len(which), 2)), "strongest": strongest}

    def change_model(self, plant: Plant, which: np.ndarray) -> None:
        solimp, rows = plant.field("geom_solimp"), self.rows[which]
        for geom in plant.object_geoms:
            solimp[rows, geom, 4] += self["extra_power"][which, 0]

    def act(self) -> Contribution:
        depth = np.maximum(depth_in_object(self, self.pad_force), 0.0)
        spring = self["spring_n"] * (depth / DEPTH_M) ** self["spring_power"]
        self.state["push"] = push = np.minimum(spring, self.state["strongest"])
        return contact_push(push)

    def interaction(self, force: np.ndarray) -> np.ndarray:
        return force + self.state["push"]
