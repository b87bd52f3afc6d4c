"""Objects slide on what they touch more easily, or less, than in the scene."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Effect, Parameter
from forcegrasp.physics.plant import Plant


class ContactFriction(Effect):
    """Another friction wherever something touches the object, the table as well as the pads.

    A simulated object creeps on its table where a finger pushes it, the faster the less friction there is. So does an
    object of another mass (``object_mass``). MuJoCo's contacts also grow softer as their friction grows, where nothing
    slides as well; a fit makes up for that by the object's softness.
    """

    name = "contact_friction"
    stage = "object"
    family = "contact"
    needs_object = True
    symptom = "a finger that touches first pushes the object further, or less far; the forces of both differ meanwhile"
    formula = "μ = c μ₀"
    source = "Coulomb's law; the scene's μ₀ is a guess for most objects"
    look_alikes = ("table_friction", "object_friction", "smooth_object_friction", "coulomb_friction", "object_mass")
    separates = "off-centre objects: what resists is felt by the finger that pushes, and not where nothing is touched"
    parameters = (
        Parameter(
            "factor", "friction ÷ the scene's, c", "1", 0.02, 20.0, 2.0,
            null=1.0, logarithmic=True, trials=(0.25, 0.5, 2.0, 4.0),
        ),
    )  # fmt: skip

    def change_model(self, plant: Plant, which: np.ndarray) -> None:
        rows = self.rows[which]
        plant.field("geom_friction")[rows, :, 0] *= self["factor"][which]
