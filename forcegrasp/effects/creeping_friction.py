"""What frictions have in common that vanish smoothly at rest: under a load the joint creeps."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Contribution, Effect, Parameter, State

#: Below this speed, m/s or rad/s, tanh(v / v_c) / v is 1 / v_c to the last digit for any v_c that is tried.
_REST = 1e-12
#: The speed below which friction falls.
CREEP = Parameter(
    "creep_m_s", "speed v_c below which it falls", "m/s", 0.0, 0.02, 5e-4, null=5e-4, trials=(5e-4,), follows="position"
)


class CreepingFriction(Effect):
    """Friction of a :meth:`level` against fast motion, and in proportion to slow motion.

    The force is taken as a damping, implicitly, so that it is stable for any v_c; that of the speed which the last two
    steps lead to expect. At v_c = 0 it is dry friction.
    """

    stage = "actuator"
    family = "friction"

    def init(self, which: np.ndarray) -> State:
        return {"velocity": self.velocity[which]}

    def level(self) -> np.ndarray:
        """Friction against fast motion, N or N·m, broadcast with ``(rows, motors)``."""
        raise NotImplementedError

    def act(self) -> Contribution:
        level, creep, now = self.level(), self["creep_m_s"], self.velocity
        dry = creep == 0
        expected = 2 * now - self.state["velocity"]
        self.state["velocity"] = now
        speed = np.maximum(np.where(expected * now > 0, np.abs(expected), 0.0), _REST)
        damping = level * np.tanh(speed / np.where(dry, 1.0, creep)) / speed
        return Contribution(friction=np.where(dry, level, 0.0), damping=np.where(dry, 0.0, damping))
