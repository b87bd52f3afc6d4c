"""Viscous friction that differs by direction."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Contribution, Effect, Parameter


class DirectionFriction(Effect):
    """Friction that grows with the speed in one direction more than in the other.

    Positive: more while opening; negative: more while closing. Dry friction that differs by direction is no effect of
    its own: it is symmetric dry friction and a constant force, `coulomb_friction` and `motor_offset`, also at rest.
    """

    name = "direction_friction"
    stage = "actuator"
    family = "friction"
    symptom = "fast motion lags more in one direction than in the other; where it rests is right"
    formula = "F = −d v while opening if d > 0, F = −|d| v while closing if d < 0"
    source = "direction-dependent viscous friction of gears and seals: Armstrong-Hélouvry et al. (1994)"
    look_alikes = ("motor_offset", "coulomb_friction", "viscous_friction", "back_emf")
    separates = "slow motion and rest, where an offset of the motor's force stays as large and this one vanishes"
    parameters = (
        Parameter(
            "excess_ns_m", "excess d, positive opening", "N·s/m", -50.0, 50.0, 5.0, trials=(3.0,), follows="damping"
        ),
    )
    order = 6

    def act(self) -> Contribution:
        excess = self["excess_ns_m"]
        return Contribution(damping=np.where(excess * self.velocity > 0, np.abs(excess), 0.0))
