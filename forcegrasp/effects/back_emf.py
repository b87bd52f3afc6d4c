"""The supply's voltage limits the motor, the more the faster it turns."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Effect, Nested, Parameter


class BackEmf(Effect):
    """A motor at its voltage limit: less force the faster it moves, none at its no-load speed, more while it brakes.

    It limits what the loop can ask for. How back-EMF damps a motor below that limit belongs to the servo's damping.
    """

    name = "back_emf"
    stage = "actuator"
    family = "drive limit"
    needs_position_loop = True
    symptom = "large steps start with full force and end in one highest speed; small ones are right"
    formula = "−F_s (1 + v / v_0) ≤ F_motor ≤ F_s (1 − v / v_0)"
    source = "torque over speed of a DC motor at constant voltage, U = R i + K v; the step's own change of v included"
    look_alikes = ("rate_limit", "force_limit", "smooth_force_limit", "actuator_lag")
    separates = (
        "steps of several sizes: a force limit has no highest speed, a rate limit no slow start; more load lowers the"
        " speed at a voltage limit, and the slope of a rate limit stays"
    )
    parameters = (
        Parameter(
            "stall_n", "largest force at rest F_s", "N", 0.005, 50.0, 0.15, null=np.inf, logarithmic=True,
            trials=(0.08, 0.3, 1.0), follows="effort",
        ),
        Parameter(
            "no_load_m_s", "speed at which no force is left v_0", "m/s", 0.001, 10.0, 0.03, null=0.03, logarithmic=True,
            trials=(0.015, 0.06, 0.2), follows="position",
        ),
    )  # fmt: skip
    contains = (Nested("force_limit", at={"no_load_m_s": np.inf}, same={"stall_n": "force_n"}),)
    order = 8

    def motor_range(self, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        stall, limited = self["stall_n"], np.isfinite(self["stall_n"])
        slope = np.where(limited, stall, 0.0) / self["no_load_m_s"]
        # of the speed after the step, to which this very force leads: so a steep limit doesn't overshoot
        steady = 1 + slope * self.dt / self.plant.inertia[self.rows]
        most, least = ((sign * stall - slope * self.velocity) / steady for sign in (1, -1))
        high = np.where(limited, np.minimum(high, most), high)
        return np.where(limited, np.minimum(np.maximum(low, least), high), low), high
