"""The driver does not pass small commands on."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Effect, Parameter, State


class CommandDeadband(Effect):
    """A command that asks for too little is dropped; the last one that was passed on stays in force.

    ``position``: too near to where the encoder says the finger is, as in TIAGo's driver. ``held``: too near to the
    command in force.
    """

    name = "command_deadband"
    stage = "command"
    family = "lost motion"
    needs_position_loop = True
    symptom = "small position deltas do nothing; slow ramps become stairs"
    formula = "u' = u if |u − q| > b (position) or |u − u'| > b (held), else u' stays"
    source = "TIAGo's driver sends no command when |q_des − q| ≤ 0.3 mm (authors' code)"
    look_alikes = ("backlash", "stiction", "position_deadband")
    separates = "slow ramps with small increments: stairs follow the commands and not the force"
    parameters = (
        Parameter(
            "threshold_m",
            "largest change that is dropped",
            "m",
            0.0,
            0.005,
            0.0003,
            trials=(1e-4, 3e-4, 8e-4, 2e-3),
            follows="position",
        ),
    )
    variants = ("position", "held")
    known_beforehand = ("held",)
    in_steps = True

    def init(self, which: np.ndarray) -> State:
        return {"held": self.position[which]}

    def command(self, command: np.ndarray, fresh: np.ndarray) -> np.ndarray:
        held = self.state["held"]
        from_where = self.encoder if self.variant == "position" else held
        sent = (np.abs(command - from_where) > self["threshold_m"]) & fresh[:, None]
        self.state["held"] = held = np.where(sent, command, held)
        return np.where(self["threshold_m"] > 0, held, command)
