"""Friction that grows with the load of the gears, and vanishes smoothly at rest."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Nested
from forcegrasp.effects.creeping_friction import CREEP, CreepingFriction
from forcegrasp.effects.load_friction import COEFFICIENT, LOADS, LOADS_NEED, load_of


class SmoothLoadFriction(CreepingFriction):
    """Greased gears that are pressed together: load friction against fast motion, in proportion to slow motion.

    The load is ``carried``, ``pressed`` or ``driven``, as load_friction has it.
    """

    name = "smooth_load_friction"
    symptom = (
        "force is lost while squeezing, the more the higher it is, and comes back as the joint creeps to its command"
    )
    formula = "F = −c W tanh(v / v_c), W = |F_motor − F_outside| (carried), |F_outside|, |F_motor − J_rotor d²q/dt²|"
    source = "load_friction with the smooth law of Andersson, Söderberg and Björklund (2007)"
    look_alikes = ("load_friction", "smooth_friction", "viscoelastic_contact", "force_lag")
    separates = (
        "holds after squeezes of several speeds: what is lost comes back in them, in every grasp at the same pace"
    )
    parameters = (COEFFICIENT, CREEP)
    variants = LOADS
    variant_needs = LOADS_NEED
    contains = (Nested("load_friction", at={"creep_m_s": 0.0}, same={"coefficient": "coefficient"}),)
    order = 11

    def level(self) -> np.ndarray:
        return self["coefficient"] * load_of(self)
