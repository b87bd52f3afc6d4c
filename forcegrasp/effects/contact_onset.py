"""Contacts press harder from the first touch on, or give way more, than in the scene."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Effect, Parameter
from forcegrasp.physics.plant import Plant


class ContactOnset(Effect):
    """Another impedance of the object's contacts where they begin to press.

    MuJoCo's own default is nearly the full impedance at once; a scene of soft objects begins with none. With more of it
    a touch at speed is felt at once, and a force is reached at a smaller depth.
    """

    name = "contact_onset"
    stage = "contact"
    family = "contact"
    needs_object = True
    symptom = "forces jump where a touch begins, or begin later than modelled, and less depth is needed to hold"
    formula = (
        "d₀ → d₀ + m (d₁ − d₀) for m > 0, d₀ → (1 + m) d₀ for m < 0, d₀ and d₁ being impedances at no depth and deep"
    )
    source = "MuJoCo's `solimp`, first two numbers (its default: d₀ = 0.9, d₁ = 0.95)"
    look_alikes = ("contact_damping", "viscoelastic_contact", "object_size", "hunt_crossley_contact")
    separates = "touches at several speeds, and slow ramps from the first touch on"
    parameters = (Parameter("share", "share of the way m", "1", -1.0, 1.0, 0.1, trials=(0.03, 0.2, 0.9)),)
    order = -1

    def change_model(self, plant: Plant, which: np.ndarray) -> None:
        solimp, rows, share = plant.field("geom_solimp"), self.rows[which], self["share"][which, 0]
        for geom in plant.object_geoms:
            first, deep = solimp[rows, geom, 0], solimp[rows, geom, 1]
            solimp[rows, geom, 0] = first + share * np.where(share > 0, deep - first, first)
