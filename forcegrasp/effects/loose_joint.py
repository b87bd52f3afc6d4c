"""A joint whose load has play on the motor."""

from __future__ import annotations

import dataclasses

import numpy as np

from forcegrasp.effects.base import Nested, Parameter
from forcegrasp.effects.elastic_joint import COMPLIANCE, LOSS, ElasticJoint


class LooseJoint(ElasticJoint):
    """Motor and load are two bodies with a gap between them, whose ends are springs; the encoder sits at the motor.

    As `elastic_joint`, but nothing holds the load while the motor crosses the gap, and its ends only push.
    """

    name = "loose_joint"
    family = "lost motion"
    contains = (
        Nested("elastic_joint", {"gap_m": 0.0}, {"compliance_m_n": "compliance_m_n", "loss_s": "loss_s"}),
    )  # fmt: skip
    symptom = "after a reversal the motor runs free for a moment, then knocks, and its effort with it"
    formula = "J_r q'' = F − F_s, J_l x'' = F_s + F_out, F_s = (b + τ (q' − x')) / c, b = q − x − clip(q − x, ± g/2)"
    source = "two-mass system with backlash: Nordin and Gutman (2002), A survey"
    look_alikes = ("elastic_joint", "backlash", "coulomb_friction", "motor_offset")
    separates = "reversals at several speeds, with loads that do not keep the gap closed"
    parameters = (
        Parameter("gap_m", "width of the gap g", "m", 0.0, 0.006, 0.0004, trials=(1e-4, 4e-4), follows="position"),
        dataclasses.replace(COMPLIANCE, doc="compliance of its ends c", typical=2e-4, trials=(2e-4,)),
        dataclasses.replace(LOSS, doc="damper of its ends ÷ their stiffness τ"),
    )
    order = 4

    @property
    def half_gap(self) -> np.ndarray:
        return self["gap_m"] / 2
