"""The smoothness term r_act = −Σ_i |a_i(t−1) − a_i(t)| (paper, eq. 10), added to the reward."""

from __future__ import annotations

import torch
from tensordict import TensorDictBase
from tensordict.utils import NestedKey
from torchrl.data import Composite, Unbounded

from forcegrasp.transforms.step_transform import StepTransform


class ActionChangePenalty(StepTransform):
    """Writes r_act and adds α₃ r_act to the reward. Both actions are the policy's own, clipped to [−1, 1].

    The first action of an episode is compared with 0.

    Args:
      weight: α₃.
      last_action_key: a(t−1), as written by :class:`LastAction`, ``(*B, motors)``.
      reward_key: the reward to add to, ``(*B, 1)``.
      out_key: where the unweighted term goes, ``(*B, 1)``.
    """

    def __init__(
        self,
        weight: float,
        last_action_key: NestedKey = "last_action",
        reward_key: NestedKey = "reward",
        out_key: NestedKey = ("reward_terms", "action"),
    ) -> None:
        super().__init__(in_keys=[reward_key], out_keys=[reward_key])
        self.weight = weight
        self.last_action_key, self.term_key = last_action_key, out_key

    def _step(self, tensordict: TensorDictBase, next_tensordict: TensorDictBase) -> TensorDictBase:
        before, now = tensordict[self.last_action_key], next_tensordict[self.last_action_key]
        term = -(before - now).abs().sum(-1, keepdim=True)
        next_tensordict.set(self.term_key, term)
        return next_tensordict.set(self.in_keys[0], next_tensordict[self.in_keys[0]] + self.weight * term)

    def _reset(self, tensordict: TensorDictBase, tensordict_reset: TensorDictBase) -> TensorDictBase:
        like = tensordict_reset[self.last_action_key]
        return tensordict_reset.set(self.term_key, torch.zeros_like(like[..., :1]))

    def transform_reward_spec(self, reward_spec: Composite) -> Composite:
        like = reward_spec[self.in_keys[0]]
        reward_spec[self.in_keys[0]] = Unbounded(shape=like.shape, dtype=like.dtype, device=like.device)
        return reward_spec

    def transform_observation_spec(self, observation_spec: Composite) -> Composite:
        like = observation_spec[self.last_action_key]
        observation_spec[self.term_key] = Unbounded(
            shape=torch.Size([*like.shape[:-1], 1]), dtype=like.dtype, device=like.device
        )
        return observation_spec
