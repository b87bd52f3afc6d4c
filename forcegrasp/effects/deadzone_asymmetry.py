"""Light touches are not read, by one force sensor less than by the other."""

from __future__ import annotations

import dataclasses

import numpy as np

from forcegrasp.effects.base import Nested
from forcegrasp.effects.each_finger import SHARE, of_each
from forcegrasp.effects.force_deadzone import ForceDeadzone


class DeadzoneAsymmetry(ForceDeadzone):
    """A dead zone of which each force sensor has its own, as skins that were mounted by hand have it.

    At a = 1 the left sensor alone hides light touches, at a = −1 the right one, and at a = 0 both do alike.
    ``subtract``, ``gate``: as those of `force_deadzone`.
    """

    name = "deadzone_asymmetry"
    symptom = "force stays 0 at a light touch, at one finger up to a larger force than at the other"
    formula = "f' as with force_deadzone, z_l = (1 + a) z, z_r = (1 − a) z"
    look_alikes = ("force_deadzone", "backlash_asymmetry", "force_bias", "force_gain_asymmetry")
    separates = "partial releases: each zone is crossed at one force, a gap at one travel"
    parameters = (
        dataclasses.replace(ForceDeadzone.parameters[0], doc="mean threshold z of both", trials=(0.02, 0.05, 0.1, 0.2)),
        SHARE,
    )
    contains = (Nested("force_deadzone", at={"share": 0.0}, same={"threshold_n": "threshold_n"}),)
    order = 6
    least_channels = 2

    @property
    def threshold(self) -> np.ndarray:
        return of_each(self, "threshold_n")
