"""The object does not slide freely on the table."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Effect, Parameter
from forcegrasp.physics.plant import Plant


class ObjectFriction(Effect):
    """Dry friction between object and table, beyond the creep that the base model has."""

    name = "object_friction"
    stage = "object"
    family = "contact"
    needs_object = True
    symptom = "the second finger's force lags; off-centre grasps push the object less far"
    formula = "|F| ≤ F_t at rest, F = −F_t sign(v) in motion"
    source = "MuJoCo's `frictionloss` on the object, with a stiff constraint"
    look_alikes = (
        "smooth_object_friction",
        "table_friction",
        "contact_friction",
        "backlash",
        "force_gain_asymmetry",
        "object_pull",
    )
    separates = "off-centre objects, where one finger touches first and pushes"
    parameters = (Parameter("force_n", "friction F_t", "N", 0.0, 5.0, 0.1, trials=(0.02, 0.06, 0.2), follows="force"),)

    def change_model(self, plant: Plant, which: np.ndarray) -> None:
        rows, dof = self.rows[which], plant.object_dof
        plant.field("dof_frictionloss")[rows, dof] += self["force_n"][which, 0]
        plant.stiffen_friction(dof, rows)
