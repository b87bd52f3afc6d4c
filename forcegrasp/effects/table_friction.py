"""Objects slide more easily, or less, on what they stand on."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Effect, Parameter
from forcegrasp.physics.ground import let_ground_decide
from forcegrasp.physics.plant import Plant


class TableFriction(Effect):
    """Another friction between the object and what it stands on; the pads rub and press as before.

    A simulated object creeps on its table where a finger pushes it, the faster the less friction there is.
    """

    name = "table_friction"
    stage = "object"
    family = "contact"
    needs_object = True
    needs_ground = True
    symptom = "a finger that touches first pushes the object further, or less far; touches are as hard as before"
    formula = "μ = c μ₀, on the ground alone"
    source = "Coulomb's law; the scene's μ₀ is a guess for most tables"
    look_alikes = ("smooth_object_friction", "object_friction", "contact_friction", "object_mass")
    separates = "off-centre objects that are held for long: where friction holds at rest, the forces go on to differ"
    parameters = (
        Parameter(
            "factor", "friction ÷ the scene's, c", "1", 0.02, 20.0, 2.0,
            null=1.0, logarithmic=True, trials=(0.25, 0.5, 2.0, 4.0),
        ),
    )  # fmt: skip
    order = 3  # after what changes how hard the object is

    def change_model(self, plant: Plant, which: np.ndarray) -> None:
        which = which[self["factor"][which, 0] != 1]
        rows = self.rows[which]
        for ground in plant.ground_geoms:
            let_ground_decide(plant, ground, rows)
            plant.field("geom_friction")[rows, ground, 0] *= self["factor"][which, 0]
