"""The contact grows stiffer the more it is squeezed."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Effect, Parameter


class StiffeningContact(Effect):
    """A steeper impedance curve of the object's contact."""

    name = "stiffening_contact"
    stage = "contact"
    symptom = "the curve of force over squeeze is more convex than modelled"
    formula = "d(r) with power p + Δp instead of p (MuJoCo's solimp)"
    source = "MuJoCo's `solimp`, last number"
    look_alikes = ("finger_compliance", "viscoelastic_contact")
    separates = "slow ramps to high force on soft objects"
    parameters = (
        Parameter("extra_power", "Δp, added to the scene's power", "1", 0.0, 8.0, 1.5, trials=(0.5, 2.0, 5.0)),
    )

    def change_model(self, plant, which: np.ndarray) -> None:
        solimp, rows = plant.field("geom_solimp"), self.rows[which]
        for geom in plant.object_geoms:
            solimp[rows, geom, 4] += self["extra_power"][which, 0]
