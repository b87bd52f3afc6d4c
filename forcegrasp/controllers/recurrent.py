"""The policy with a memory: a GRU (Cho et al. 2014) over the whole grasp, beside the stacked observation."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, cast

import torch
from tensordict.nn import AddStateIndependentNormalScale, TensorDictModule, TensorDictSequential
from torch import Tensor, nn
from torch.nn.functional import linear
from torchrl.data import Unbounded
from torchrl.envs.transforms import Compose, InitTracker, TensorDictPrimer, Transform
from torchrl.modules import GRUModule, IndependentNormal, ProbabilisticActor

from forcegrasp.config import PPOConfig
from forcegrasp.controllers.mean_network import Mirror, make_mean
from forcegrasp.physics.gripper import Gripper


class RecurrentPolicy(ProbabilisticActor):
    """A Gaussian over actions whose mean depends on what was observed, and on what the GRU remembers of the grasp.

    A mirrored policy has two memories with the same weights, of the grasp and of its mirror image.
    """

    def make_tensordict_primer(self) -> Transform:
        """What an environment needs: it marks where an episode starts, and the memories are zero there."""
        spec, keys = Unbounded(torch.Size([1, self.gru.hidden_size])), cast("list[str]", self.in_keys)
        memories: Any = {key: spec for key in keys if key.endswith("memory")}
        return Compose([InitTracker(), cast(Any, TensorDictPrimer)(memories, expand_specs=True)])

    @property
    def gru(self) -> nn.GRU:
        """What both memories share."""
        return cast(Any, self[0])[-2].gru


class Head(nn.Module):
    """Mean and deviation of the action from the observation and the GRU's output.

    Args:
      mean: ``(*B, size + memories · units) -> (*B, motors)``; a mirrored one takes the memories as pairs.
      scale: ``(*B, motors) ->`` the same and the deviations.
    """

    def __init__(self, mean: nn.Module, scale: nn.Module) -> None:
        super().__init__()
        self.mean, self.scale = mean, scale

    def forward(self, observation: Tensor, *remembered: Tensor) -> tuple[Tensor, Tensor]:
        """Both ``(*B, motors)``; ``remembered`` are one or two tensors ``(*B, units)``."""
        return self.scale(self.mean_action(observation, *remembered))

    def mean_action(self, observation: Tensor, *remembered: Tensor) -> Tensor:
        return self.mean(torch.cat([observation, torch.stack(remembered, -1).flatten(-2)], -1))


def make_recurrent_policy(
    sizes: Sequence[int], config: PPOConfig, gripper: Gripper, contact: Sequence[int] = ()
) -> RecurrentPolicy:
    """Reads ``observation`` ``(*B, sum(sizes))``, ``is_init`` and memories; writes ``action``, ``action_log_prob`` and
    the next memories. Arguments as for :func:`~forcegrasp.controllers.policy.make_policy`.
    """
    mirrored, units = config.mirrored and gripper.is_symmetric, config.memory
    gru = nn.GRU(sum(sizes), units, batch_first=True)
    names = ["", "mirrored_"] if mirrored else [""]
    memories = [
        GRUModule(
            gru=gru,
            in_keys=[f"{name}observation", f"{name}memory", "is_init"],
            out_keys=[f"{name}remembered", ("next", f"{name}memory")],
        )
        for name in names
    ]
    mirror = [TensorDictModule(Mirror(sizes), ["observation"], ["mirrored_observation"])] if mirrored else []
    scale = AddStateIndependentNormalScale(len(gripper.motors), init_value=config.log_std)
    head = Head(make_mean([*sizes, *[len(names)] * units], config, gripper, contact), scale)
    seen = cast(Any, ["observation", *(f"{name}remembered" for name in names)])
    modules = cast(Any, [*mirror, *memories, TensorDictModule(head, seen, ["loc", "scale"])])
    return RecurrentPolicy(
        TensorDictSequential(*modules),
        in_keys=["loc", "scale"],
        distribution_class=IndependentNormal,
        return_log_prob=True,
    )


class RecurrentNetwork(nn.Module):
    """A recurrent policy's mean action, one step at a time: what is exported.

    Attributes:
      size: how many numbers the memory has.

    Args:
      policy: what decides.
    """

    def __init__(self, policy: RecurrentPolicy) -> None:
        super().__init__()
        modules = cast(Any, policy[0])
        self.head, self.gru = cast(Head, modules[-1].module), policy.gru
        self.mirror = modules[0].module if len(modules) == 4 else None
        self.size = self.gru.hidden_size * (1 if self.mirror is None else 2)

    def forward(self, observation: Tensor, memory: Tensor) -> tuple[Tensor, Tensor]:
        """``(1, n), (1, size) -> (1, motors), (1, size)``."""
        seen = observation if self.mirror is None else torch.cat([observation, self.mirror(observation)])
        before, gru = memory.reshape(len(seen), -1), dict(self.gru.named_parameters())
        # the cell's own equations: a step needs no operator for sequences
        reset_i, update_i, new_i = linear(seen, gru["weight_ih_l0"], gru["bias_ih_l0"]).chunk(3, -1)
        reset_h, update_h, new_h = linear(before, gru["weight_hh_l0"], gru["bias_hh_l0"]).chunk(3, -1)
        update = torch.sigmoid(update_i + update_h)
        after = (1 - update) * torch.tanh(new_i + torch.sigmoid(reset_i + reset_h) * new_h) + update * before
        return self.head.mean_action(observation, *after.split(1)), after.reshape(1, -1)
