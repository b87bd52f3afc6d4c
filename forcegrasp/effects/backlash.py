"""Lost motion between motor and pad."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Contribution, Effect, Parameter, State
from forcegrasp.effects.touch import depth_in_object, pad_reach, untouched
from forcegrasp.physics.contact_law import ContactLaw

# A motor that is slower than this makes no difference to a contact's damping.
_CREEP_M_S = 2e-5
# How much deeper contacts are moved at most. Light ones in front of a fast motor would have to be many times as deep:
# what a step's motor differs from the last one's would press hard there.
_DEEPEST = 1.5


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
    look_alikes = (
        "two_mass_backlash",
        "loose_joint",
        "force_deadzone",
        "adhesion",
        "coulomb_friction",
        "elastic_transmission",
    )
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
        memory = {"pad": self.position[which]}
        if self.variant != "play":
            return memory
        apart = self.plant.clearance(self.rows[which])
        return memory | {
            "behind": apart - apart.min(axis=2, keepdims=True),  # pads behind the foremost of their side
            "contact": self.plant.contact_numbers(self.rows[which]),
            "surface": untouched(which),
            "reach": pad_reach(self)[which],
            "motor": self.position[which],
            "passing": np.zeros((len(which), 2)),  # speed of motors whose pads stood still in the last step
            "further": np.zeros((len(which), 2)),
        }

    @property
    def gap(self) -> np.ndarray:
        """Lost motion, m or rad, broadcast with ``(rows, motors)``."""
        return self["gap_m"]

    def command(self, command: np.ndarray, fresh: np.ndarray) -> np.ndarray:
        return self._follow(command) if self.variant == "command" else command

    def act(self) -> Contribution:
        if self.variant == "command":
            return Contribution()
        motor, before = self.position, self.state["pad"]
        pad = self._follow(motor)
        shift = self.plant.to_sides(pad - motor)
        if self.variant == "play":
            return Contribution(pad_shift_m=shift, contact_shift_m=self._for_pads_that_stand(pad == before, shift))
        self.state["pad"] = pad = np.where(self.plant.presses(self.rows), motor + self.gap / 2, pad)
        return Contribution(pad_shift_m=self.plant.to_sides(pad - motor))

    def _follow(self, motor: np.ndarray) -> np.ndarray:
        half = self.gap / 2
        self.state["pad"] = pad = np.where(half == 0, motor, np.clip(self.state["pad"], motor - half, motor + half))
        return pad

    def _for_pads_that_stand(self, stand: np.ndarray, shift: np.ndarray) -> np.ndarray:
        """Shift by which contacts press as on pads that stand while their motors move, metres, ``(rows, 2)``.

        MuJoCo damps them by the speed of the bodies that the pads are on, those of the motors.

        Args:
          stand: which motors' pads, ``(rows, motors)``.
          shift: of the pads, metres, ``(rows, 2)``.
        """
        state, dt, motor, reach = self.state, self.dt, self.position, pad_reach(self)
        passing = self.plant.to_sides(np.where(stand, motor - state["motor"], 0.0)) / dt
        pushed = np.where((passing != 0) & (state["passing"] != 0), (passing - state["passing"]) / dt, 0.0)
        depth = depth_in_object(self, self.pad_force, reach) - shift
        closing = (state["reach"] - reach) / dt
        further = np.zeros_like(shift)
        row, _ = at = np.nonzero((np.abs(passing) > _CREEP_M_S) & (depth > 0))
        if len(row):
            law, near = ContactLaw(state["contact"][row], state["behind"][at]), depth[at] - state["further"][at]
            force = law.force(depth[at], law.damping * (closing + passing)[at])
            found = law.depth(force, law.damping * closing[at] - pushed[at], np.where(near > 0, near, depth[at]))
            further[at] = depth[at] - np.minimum(found, _DEEPEST * depth[at])
        state.update(motor=motor, passing=passing, reach=reach, further=further)
        return further
