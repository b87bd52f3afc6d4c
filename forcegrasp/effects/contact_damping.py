"""Contacts are damped otherwise than in the scene, and stiffer or softer."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Effect, Parameter
from forcegrasp.physics.plant import Plant


class ContactDamping(Effect):
    """Another damping and another stiffness of all that touches, by the law of the scene.

    The scene's are a guess. A squeeze that is held hardly tells: a softer object makes up for a stiffer contact, and
    nothing but a touch at speed shows the damping. An object creeps on its table by the same law: the less, the more
    its contact with it is damped.

    MuJoCo damps no contact within less than two of its steps, so that cheaper tiers with longer steps know less of
    stronger damping.
    """

    name = "contact_damping"
    stage = "contact"
    family = "contact"
    needs_object = True
    symptom = "forces of a touch grow sooner, or later and beyond where they settle; held ones are nearly right"
    formula = "b → c b and k → s k in MuJoCo's contacts, which aim at an acceleration of −b v − k d r"
    source = 'MuJoCo\'s documentation, Computation, "Constraint model"; b and k are what `solref` gives'
    look_alikes = (
        "contact_friction", "hunt_crossley_contact", "viscoelastic_contact", "finger_compliance", "object_size",
    )  # fmt: skip
    separates = "touches at several speeds, and objects that one finger pushes"
    parameters = (
        Parameter("damping", "damping ÷ the scene's, c", "1", 0.1, 5.0, 0.6, null=1.0, logarithmic=True),
        Parameter("stiffness", "stiffness ÷ the scene's, s", "1", 0.05, 20.0, 1.0, null=1.0, logarithmic=True),
    )
    order = -2

    @classmethod
    def trials(cls) -> np.ndarray:
        return np.array([[0.4, 1.0], [2.0, 1.0], [1.0, 0.25], [1.0, 4.0]])

    def change_model(self, plant: Plant, which: np.ndarray) -> None:
        rows, damping, stiffness = self.rows[which], self["damping"][which], self["stiffness"][which]
        solref = plant.field("geom_solref")
        first, second = solref[rows, :, 0], solref[rows, :, 1]
        of_times = first > 0  # a time constant 2 / b and a damping ratio b / 2 √k; else they are −k and −b
        # a time constant that MuJoCo would lengthen would change the stiffness, too
        time = np.where(of_times, np.maximum(first / damping, np.minimum(first, 2 * plant.dt)), 1.0)
        solref[rows, :, 0] = np.where(of_times, time, first * stiffness)
        solref[rows, :, 1] = second * np.where(of_times, first / time / np.sqrt(stiffness), damping)
