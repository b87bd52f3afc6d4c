"""Controllers to hold others against: doing nothing, only closing, and a feed-forward that knows the object."""

from __future__ import annotations

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase

from forcegrasp.physics.parameters import MAX_FORCE_N, force_scale_of_kappa


class Constant(TensorDictModuleBase):
    """The same action at every step, as in the paper's identification trials.

    Args:
      value: the action of both fingers, in [−1, 1]; −1 closes at full speed.
    """

    def __init__(self, value: float) -> None:
        super().__init__()
        self.in_keys, self.out_keys = ["had_contact"], ["action"]
        self.value = value

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        return tensordict.set("action", torch.full_like(tensordict.get("had_contact"), self.value))


class InformedFeedForward(TensorDictModuleBase):
    """Static feed-forward that is told the object's force scale: waits on first touch, then commands one position.

    f = 100 N/m · f_α · Δq at rest in the simulator, hence a = −f_goal / (0.30 N · f_α) from the second touch on. It
    looks at no force and makes nothing faster, so that it is no upper bound: the force rises as the servo lets it, and
    a controller that pushes harder at first can be better.
    """

    def __init__(self) -> None:
        super().__init__()
        self.in_keys, self.out_keys = ["had_contact", "goal_force", "grasp_parameters"], ["action"]

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        touched, goal, parameters = (tensordict.get(key) for key in self.in_keys)
        both = touched.bool().all(-1, keepdim=True)
        hold = (-goal / (MAX_FORCE_N * force_scale_of_kappa(parameters[..., :1]))).expand_as(touched)
        return tensordict.set("action", torch.where(both, hold, touched - 1).clamp(-1, 1))
