"""Objects are heavier than in the scene, or lighter."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Effect, Parameter
from forcegrasp.physics.plant import Plant


class ObjectMass(Effect):
    """Another mass of all objects.

    A light object gives way sooner where one finger pushes it, and its table holds it less. MuJoCo's contacts press
    less between lighter bodies besides, as their law is one of accelerations.
    """

    name = "object_mass"
    stage = "object"
    family = "contact"
    needs_object = True
    symptom = "a finger that touches first pushes the object further, or less far, and touches are harder or softer"
    formula = "m = c m₀, I = c I₀"
    source = "Newton's second law; the scene's m₀ is a guess for most objects"
    look_alikes = ("contact_friction", "table_friction", "contact_damping", "object_friction", "actuator_lag")
    separates = "a balance; else off-centre objects, and touches at several speeds"
    parameters = (
        Parameter(
            "factor", "mass ÷ the scene's, c", "1", 0.05, 20.0, 2.0, null=1.0, logarithmic=True, trials=(0.4, 2.5)
        ),
    )
    order = 2

    def change_model(self, plant: Plant, which: np.ndarray) -> None:
        multiply_mass(plant, self.rows[which], self["factor"][which])


def multiply_mass(plant: Plant, rows: np.ndarray, factor: np.ndarray) -> None:
    """Makes the objects of some rows heavier by a factor, ``(n, 1)``, evenly."""
    body = plant.model.geom_bodyid[plant.object_geoms[0]]
    plant.field("body_mass")[rows, body] *= factor[:, 0]
    plant.field("body_inertia")[rows, body] *= factor
