"""Lost motion between motor and pad."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Contribution, Effect, Parameter, State


class Backlash(Effect):
    """After each reversal the motor crosses a gap before the pad follows.

    ``play``: the pad stays where it is while the motor crosses; the encoder sits at the motor. ``loose``: the same,
    but an object in the grasp pushes the pad against the motor, so that nothing is lost under load. ``command``: the
    gap lies before the encoder.
    """

    name = "backlash"
    stage = "transmission"
    family = "lost motion"
    symptom = "motion is lost after each reversal, however small the load; contact comes late"
    formula = "p ← clip(p, m − g/2, m + g/2)"
    source = "play operator (Krasnosel'skii and Pokrovskii 1989)"
    look_alikes = ("force_deadzone", "adhesion", "coulomb_friction", "elastic_transmission")
    separates = "pauses, reversals and partial releases in contact, at several speeds"
    parameters = (
        Parameter(
            "gap_m", "lost motion g", "m", 0.0, 0.006, 0.0006, trials=(1e-4, 3e-4, 1e-3, 2e-3), follows="position"
        ),
    )
    variants = ("play", "loose", "command")
    known_beforehand = ("command",)
    follows_motion = True
    variant_needs = {"play": "pads", "loose": "pads", "command": "position loop"}  # noqa: RUF012 never changed

    def init(self, which: np.ndarray) -> State:
        return {"pad": self.position[which]}

    def command(self, command: np.ndarray, fresh: np.ndarray) -> np.ndarray:
        return self._follow(command) if self.variant == "command" else command

    def act(self) -> Contribution:
        if self.variant == "command":
            return Contribution()
        motor = self.position
        pad = self._follow(motor)
        if self.variant == "loose":
            self.state["pad"] = pad = np.where(self.plant.presses(self.rows), motor + self["gap_m"] / 2, pad)
        return Contribution(pad_shift_m=self.plant.to_sides(pad - motor))

    def _follow(self, motor: np.ndarray) -> np.ndarray:
        half = self["gap_m"] / 2
        self.state["pad"] = pad = np.where(half == 0, motor, np.clip(self.state["pad"], motor - half, motor + half))
        return pad
