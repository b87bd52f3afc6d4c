"""A teacher that knows the object, for a student that can only feel it: kickstarting (Schmitt et al. 2018)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import torch
from tensordict import TensorDictBase
from torch import Tensor

from forcegrasp.controllers.reference import InformedFeedForward
from forcegrasp.physics.gripper import Gripper

#: By how much a cautious student may close harder than its teacher at no further cost: noise must not make it let go.
FREE = 0.1
# What closes fast is taught a little more than full speed, which is no more: a student that errs closes as fast then.
_CLOSING = 1.2


class Teacher:
    """What ``informed`` would have done in the states that a student met, corrected by the true forces.

    Args:
      gripper: what grasps.
      feedback: K; once every reading has shown contact, the action that holds the goal is multiplied by
        1 + K κ (1 − f / f_goal), with the mean f of the true forces. The softer an object (κ), the slower its force
        follows, and the more a harder push at first helps; a hard one's force would shoot beyond the goal.
    """

    def __init__(self, gripper: Gripper, feedback: float) -> None:
        self.controller, self.feedback = InformedFeedForward(gripper), feedback

    def label(self, batch: TensorDictBase) -> None:
        """Writes ``taught_action``, and ``taught_unit``, in which its errors are measured, ``(*B, motors)``.

        With all fingers in contact the unit is the action that holds the goal: errors are then those of the force as
        a fraction of its goal, so that a student in doubt of the stiffness presses gently.
        """
        state = batch.select(*self.controller.in_keys)
        action, goal, force = self.controller(state)["action"], state["goal_force"], batch["force"]
        grasped = state.get("had_contact").bool().all(-1, keepdim=True)
        softness = state["grasp_parameters"][..., :1]
        correction = 1 + self.feedback * softness * (1 - force.mean(-1, keepdim=True) / goal)
        taught = torch.where(grasped, (action * correction).clamp(-1, 1), action * _CLOSING)
        unit = torch.where(grasped, -self.controller.hold(goal, state["grasp_parameters"]), 1.0)
        batch.set("taught_action", taught).set("taught_unit", unit.expand_as(action))


def imitation_loss(action: Tensor, frames: Mapping[Any, Tensor] | TensorDictBase, caution: float = 0.0) -> Tensor:
    """Mean square of a student's error, in the teacher's units.

    Args:
      action: the student's mean, ``(*B, motors)``.
      frames: as :meth:`Teacher.label` left them.
      caution: weight of the square of what a student closes harder by than the teacher, beyond ``FREE``.
    """
    error = (action - frames["taught_action"]) / frames["taught_unit"]
    return (error.square() + caution * (-error - FREE).clamp_min(0).square()).sum(-1).mean()


def imitation_slope(action: Tensor, frames: Mapping[Any, Tensor] | TensorDictBase, caution: float = 0.0) -> Tensor:
    """The gradient of :func:`imitation_loss` with respect to the student's mean, ``(n, motors)``."""
    error = (action - frames["taught_action"]) / frames["taught_unit"]
    return (error - caution * (-error - FREE).clamp_min(0)) * (2 / len(action)) / frames["taught_unit"]
