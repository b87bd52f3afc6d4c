"""The motor gives less and less of what is asked of it."""

from __future__ import annotations

import dataclasses

import numpy as np

from forcegrasp.effects.base import Effect, Nested
from forcegrasp.effects.bent import KNEE, bent
from forcegrasp.effects.force_limit import LIMIT


class SmoothForceLimit(Effect):
    """A motor whose force bends towards a largest one, as iron saturates and drives fold back their current.

    At k = 0 it gives all that is asked up to F; with k = 0.4 nearly F tanh(f / F).
    """

    name = "smooth_force_limit"
    stage = "actuator"
    family = "drive limit"
    needs_position_loop = True
    symptom = "the harder it squeezes, the further the finger stops short of its command; light squeezes are right"
    formula = "F_motor = f / (1 + |f / F|^(1/k))^k, f = k_p (u − q) − k_v v; F_motor = clip(f, −F, F) at k = 0"
    source = "saturation of a motor's iron; the blend of two asymptotes of Churchill and Usagi (1972)"
    look_alikes = ("force_limit", "force_saturation", "back_emf")
    separates = "the finger's position: a motor that gives less stops short, a sensor that reads less does not"
    parameters = (LIMIT, dataclasses.replace(KNEE, high=0.5, typical=0.4, null=0.4, trials=(0.4,)))
    contains = (Nested("force_limit", at={"knee": 0.0}, same={"force_n": "force_n"}),)
    order = 9

    def motor_range(self, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        asked, level = self.plant.asked_force[self.rows], self["force_n"]
        given = bent(asked, level, self["knee"])
        # what is asked in full is no limit: the engine takes a step that one cuts short in another way
        high = np.minimum(high, np.where(given < asked, np.maximum(given, low), level))
        return np.maximum(low, np.where(given > asked, np.minimum(given, high), -level)), high
