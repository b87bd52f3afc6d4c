"""The policy's last action as an observation, a(t−1), clipped to [−1, 1] (paper, Sec. 4); 0 at the start."""

from __future__ import annotations

import torch
from tensordict import TensorDictBase
from tensordict.utils import NestedKey
from torchrl.data import Bounded, Composite

from forcegrasp.transforms.step_transform import StepTransform


class LastAction(StepTransform):
    """Writes the action that led to this state, as the policy gave it, clipped to [−1, 1].

    Args:
      action_key: the policy's action, ``(*B, d)``.
      out_key: where it is remembered, ``(*B, d)``.
      like: an observation of the same batch size and dtype, with as many entries as there are actions.
    """

    def __init__(
        self, action_key: NestedKey = "action", out_key: NestedKey = "last_action", like: NestedKey = "joint_position"
    ) -> None:
        super().__init__(in_keys=[like], out_keys=[out_key])
        self.action_key = action_key

    def _step(self, tensordict: TensorDictBase, next_tensordict: TensorDictBase) -> TensorDictBase:
        like = next_tensordict[self.in_keys[0]]
        return next_tensordict.set(self.out_keys[0], tensordict[self.action_key].clamp(-1, 1).to(like.dtype))

    def _reset(self, tensordict: TensorDictBase, tensordict_reset: TensorDictBase) -> TensorDictBase:
        return tensordict_reset.set(self.out_keys[0], torch.zeros_like(tensordict_reset[self.in_keys[0]]))

    def transform_observation_spec(self, observation_spec: Composite) -> Composite:
        like = observation_spec[self.in_keys[0]]
        observation_spec[self.out_keys[0]] = Bounded(-1, 1, shape=like.shape, dtype=like.dtype, device=like.device)
        return observation_spec
