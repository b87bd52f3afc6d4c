"""Friction in proportion to the speed, beyond the scene's own damping."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Contribution, Effect, Parameter


class ViscousFriction(Effect):
    """A force against motion that grows with its speed, as of grease, seals and eddy currents.

    For descriptions whose base parameters have no damping: where one writes it, or the servo's gain on the velocity,
    and no effort is read that would tell the two apart, that does the same.
    """

    name = "viscous_friction"
    stage = "actuator"
    family = "friction"
    repeats_damping = True
    symptom = "fast motion lags more than modelled, in both directions alike; slow motion and rest are right"
    formula = "F = −d v"
    source = "viscous friction: Armstrong-Hélouvry et al. (1994)"
    look_alikes = ("smooth_friction", "direction_friction", "back_emf", "actuator_lag")
    separates = "steady motion at several speeds: a lag in time is the same at each, friction in proportion to it"
    parameters = (Parameter("damping_ns_m", "damping d", "N·s/m", 0.0, 50.0, 5.0, trials=(3.0,), follows="damping"),)
    acts_alike = True
    order = 15

    def act(self) -> Contribution:
        return Contribution(damping=self["damping_ns_m"] + np.zeros_like(self.velocity))
