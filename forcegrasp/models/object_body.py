"""What a grasped object is, besides its size and softness."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Effect, Parameter
from forcegrasp.effects.object_mass import multiply_mass
from forcegrasp.physics.plant import Plant


class ObjectBody(Effect):
    """An object of another mass, and other friction wherever something touches it, than the scene's.

    It is drawn with a robot. A diagnosis looks for each by itself, as ``contact_friction`` and ``object_mass``.
    """

    name = "object_body"
    stage = "object"
    family = "contact"
    needs_object = True
    symptom = "the first finger pushes a light object further"
    formula = "m = a m₀, I = a I₀, μ = c μ₀"
    source = "own"
    parameters = (
        Parameter("mass_factor", "mass a", "1", 0.01, 100.0, 1.0, null=1.0),
        Parameter("friction_factor", "friction c", "1", 0.0, 10.0, 1.0, null=1.0),
    )

    def change_model(self, plant: Plant, which: np.ndarray) -> None:
        rows = self.rows[which]
        multiply_mass(plant, rows, self["mass_factor"][which])
        plant.field("geom_friction")[rows, :, 0] *= self["friction_factor"][which]
