"""The object creeps on the table before it slides."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Effect, Nested, Parameter
from forcegrasp.physics.plant import Plant


class SmoothObjectFriction(Effect):
    """Friction between object and table that is in proportion to the speed until it slides: under a push it creeps.

    Soft and damp objects do so, and so do many simulators, in which friction that holds at rest is hard to write. At
    v_c = 0 it is dry friction.
    """

    name = "smooth_object_friction"
    stage = "object"
    family = "contact"
    needs_object = True
    symptom = "an object that one finger pushes gives way slowly; the forces of both fingers differ, and then even out"
    formula = "F = −F_t clip(v / v_c, −1, 1)"
    source = "MuJoCo's `frictionloss` on the object, with a constraint that is damped as much; Andersson et al. (2007)"
    look_alikes = ("object_friction", "table_friction", "contact_friction")
    separates = "off-centre objects that are held for long: where friction holds at rest, the forces go on to differ"
    parameters = (
        Parameter("force_n", "friction F_t", "N", 0.0, 5.0, 0.1, trials=(0.02, 0.06, 0.2), follows="force"),
        Parameter(
            "creep_m_s", "speed v_c at which it slides", "m/s", 0.0, 0.05, 1e-3, null=1e-3, trials=(1e-3,),
            follows="position",
        ),
    )  # fmt: skip
    order = 1  # after object_friction, beside which all friction creeps
    contains = (Nested("object_friction", at={"creep_m_s": 0.0}, same={"force_n": "force_n"}),)

    def change_model(self, plant: Plant, which: np.ndarray) -> None:
        which, dof = which[self["force_n"][which, 0] > 0], plant.object_dof
        plant.field("dof_frictionloss")[self.rows[which], dof] += self["force_n"][which, 0]
        plant.let_friction_creep(dof, self.rows[which], self["creep_m_s"][which, 0])
