"""The motor's force has a limit."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Effect, Parameter
from forcegrasp.physics.plant import Plant

#: The largest force of a motor.
LIMIT = Parameter(
    "force_n", "largest motor force F_max", "N", 0.005, 50.0, 0.15, null=np.inf, logarithmic=True,
    trials=(0.05, 0.1, 0.2, 0.4, 0.8), follows="effort",
)  # fmt: skip


class ForceLimit(Effect):
    """A motor that gives no more than so much force, whatever is commanded."""

    name = "force_limit"
    stage = "actuator"
    family = "drive limit"
    symptom = "force reaches a plateau whatever the command; fast motion is slower than modelled"
    formula = "|F_motor| ≤ F_max"
    source = "MuJoCo's actuator `forcerange`"
    look_alikes = ("smooth_force_limit", "force_saturation", "rate_limit", "back_emf")
    separates = "the finger's position: a limited motor stops closing, a saturated sensor does not"
    parameters = (LIMIT,)
    order = 2

    def change_model(self, plant: Plant, which: np.ndarray) -> None:
        limit, rows, ranges = self["force_n"][which, 0], self.rows[which], plant.field("actuator_forcerange")
        for actuator in plant.actuators:
            ranges[rows, actuator, 0] = np.maximum(ranges[rows, actuator, 0], -limit)
            ranges[rows, actuator, 1] = np.minimum(ranges[rows, actuator, 1], limit)
