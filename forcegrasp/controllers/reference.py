"""Baselines: doing nothing, only closing, and a feed-forward that knows the object."""

from __future__ import annotations

from typing import Any

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torch import Tensor

from forcegrasp.physics.gripper import Gripper
from forcegrasp.physics.gripper_file import default_gripper


class Constant(TensorDictModuleBase):
    """The same action at every step, as in the paper's identification trials.

    Args:
      value: the action of all motors, in [−1, 1]; −1 closes at full speed.
    """

    def __init__(self, value: float) -> None:
        super().__init__()
        self.in_keys, self.out_keys = ["joint_position"], ["action"]
        self.value = value

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        return tensordict.set("action", torch.full_like(tensordict.get("joint_position"), self.value))


class InformedFeedForward(TensorDictModuleBase):
    """Static feed-forward that knows the object's force scale: waits on first touch, then commands one position.

    f = f_max · f_α · Δq / Δq_max at rest in the simulator, hence a = −f_goal / (f_max · f_α) once every reading has
    shown contact. It looks at no force and makes nothing faster, so that it is no upper bound: the force rises as the
    servo lets it, and a controller that pushes harder at first can be better.
    """

    def __init__(self, gripper: Gripper | None = None) -> None:
        super().__init__()
        gripper = gripper or default_gripper()
        self.in_keys, self.out_keys = ["had_contact", "goal_force", "grasp_parameters"], ["action"]
        self.motors, self.reached = len(gripper.motors), gripper.training  # `training` is torch's own

    def hold(self, goal: Tensor, parameters: Tensor) -> Tensor:
        """The action whose force is the goal at rest, ``(*B, 1)``, from the goal and what is known of the grasp."""
        kappa: Any = parameters[..., :1]
        return (-goal / (self.reached.max_force_n * self.reached.force_scale(kappa))).clamp(-1, 1)

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        touched, goal, parameters = (tensordict.get(key) for key in self.in_keys)
        all_touched = touched.bool().all(-1, keepdim=True)
        waiting = (touched if touched.shape[-1] == self.motors else all_touched.to(goal.dtype)) - 1
        hold = self.hold(goal, parameters)
        action = torch.where(all_touched, hold, waiting)
        return tensordict.set("action", action.expand(*action.shape[:-1], self.motors))
