"""PPO for a policy with a memory: minibatches are whole grasps, and gradients go back through all of their steps."""

from __future__ import annotations

from typing import Any, cast

from tensordict import TensorDictBase
from torch import Tensor
from torchrl.modules import set_recurrent_mode

from forcegrasp.train.algorithms.ppo import PPO


class RecurrentPPO(PPO):
    """:class:`PPO` by backpropagation through time. The value network has no memory: it may see the true state."""

    def update(self, batch: TensorDictBase) -> dict[str, float]:
        with set_recurrent_mode(True):
            return super().update(batch)

    def samples(self, batch: TensorDictBase) -> tuple[TensorDictBase, int]:
        return batch.select(*cast(Any, self.read)), max(1, self.config.minibatch // batch.shape[1])

    def gaussian(self, frames: Any) -> tuple[Tensor, Tensor]:
        found = cast(Any, self.policy[0])(frames.select(*self.policy.in_keys))
        return found["loc"], found["scale"]
