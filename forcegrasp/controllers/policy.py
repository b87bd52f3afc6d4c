"""The learned policy: a Gaussian over actions whose mean is a small tanh network of the stacked observation."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import accumulate
from typing import cast

import torch
from tensordict.nn import AddStateIndependentNormalScale, TensorDictModule
from torch import Tensor, nn
from torchrl.modules import MLP, IndependentNormal, ProbabilisticActor

from forcegrasp.config import AlgorithmConfig, ObservationConfig, TrainConfig
from forcegrasp.errors import ConfigError
from forcegrasp.observation import PARTS
from forcegrasp.physics.gripper import Gripper
from forcegrasp.physics.gripper_file import default_gripper


class Mirrored(nn.Module):
    """Averages a network with its own mirror image: with left and right swapped at its input and back at its output.

    The gripper is its own mirror image. A policy that is too treats both fingers alike, and can't push the
    object steadily to one side.

    Args:
      net: ``(*B, size) -> (*B, 2)``; its output is the pair (left, right).
      sizes: of the observation's parts in their order: 2 for a pair, 1 for a number that is the same in the mirror.
    """

    order: Tensor

    def __init__(self, net: nn.Module, sizes: Sequence[int]) -> None:
        super().__init__()
        self.net = net
        starts = accumulate(sizes, initial=0)
        order = [start + k for start, size in zip(starts, sizes, strict=False) for k in reversed(range(size))]
        self.register_buffer("order", torch.tensor(order), persistent=False)

    def forward(self, observation: Tensor) -> Tensor:
        """Both actions, ``(*B, 2)``."""
        swapped = observation[..., self.order]
        own, mirrored = self.net(torch.stack([observation, swapped])).unbind(0)
        return (own + mirrored.flip(-1)) / 2


class SqueezeTogether(nn.Module):
    """Gives all motors the mean of their actions once every reading has shown contact (as in Lach et al. 2022).

    The noise of one finger's reading then changes how hard both squeeze, and can't push the object.

    Args:
      net: ``(*B, size) -> (*B, motors)``.
      contact: where the observation has ``had_contact`` in its newest frame.
    """

    contact: Tensor

    def __init__(self, net: nn.Module, contact: Sequence[int]) -> None:
        super().__init__()
        self.net = net
        self.register_buffer("contact", torch.tensor(contact), persistent=False)

    def forward(self, observation: Tensor) -> Tensor:
        """All actions, ``(*B, motors)``."""
        action = self.net(observation)
        grasped = (observation[..., self.contact] > 0.5).all(-1, keepdim=True)
        return torch.where(grasped, action.mean(-1, keepdim=True), action)


def part_sizes(gripper: Gripper, config: ObservationConfig) -> list[int]:
    """How many numbers each part of the stacked observation has, in its order."""
    return [PARTS[part].size(len(gripper.motors), len(gripper.forces)) for part in config.parts] * config.frames


def policy_of(config: TrainConfig, gripper: Gripper) -> ProbabilisticActor:
    """The policy of a training, as it starts.

    Raises:
      ConfigError: if its motors are to squeeze together and it can't see when.
    """
    sizes, parts, options = part_sizes(gripper, config.observation), config.observation.parts, config.algorithm
    if not options.squeeze_together:
        return make_policy(sizes, options, gripper)
    if "had_contact" not in parts:
        raise ConfigError(f"{options.name}.squeeze_together: add had_contact to observation.parts")
    newest = len(sizes) - len(parts) + parts.index("had_contact")
    return make_policy(sizes, options, gripper, range(sum(sizes[:newest]), sum(sizes[: newest + 1])))


def make_policy(
    sizes: Sequence[int], config: AlgorithmConfig, gripper: Gripper | None = None, contact: Sequence[int] = ()
) -> ProbabilisticActor:
    """Reads ``observation`` ``(*B, sum(sizes))``, writes ``action`` ``(*B, motors)`` and ``action_log_prob``.

    The standard deviation does not depend on the state. Actions are not squashed: the environment clips them to
    [−1, 1] (paper, Sec. 4).

    Args:
      sizes: of the parts of the stacked observation, see :func:`part_sizes`.
      config: size of the network, initial mean and deviation, and whether it is :class:`Mirrored`.
      gripper: how many motors there are, and whether it is its own mirror image; the paper's by default.
      contact: where the newest frame has ``had_contact``, if the motors are to :class:`SqueezeTogether`.
    """
    gripper = gripper or default_gripper()
    actions = len(gripper.motors)
    net = MLP(in_features=sum(sizes), out_features=actions, num_cells=list(config.hidden), activation_class=nn.Tanh)
    last = cast(nn.Linear, net[-1])
    nn.init.orthogonal_(last.weight, gain=0.01)
    nn.init.constant_(last.bias, config.initial_action)
    mean = Mirrored(net, sizes) if config.mirrored and gripper.is_symmetric else net
    mean = SqueezeTogether(mean, contact) if contact else mean
    scale = AddStateIndependentNormalScale(actions, init_value=config.log_std)
    return ProbabilisticActor(
        TensorDictModule(nn.Sequential(mean, scale), in_keys=["observation"], out_keys=["loc", "scale"]),
        in_keys=["loc", "scale"],
        distribution_class=IndependentNormal,
        return_log_prob=True,
    )


def log_prob(action: Tensor, loc: Tensor, scale: Tensor) -> Tensor:
    """Logarithm of the density of independent Gaussians, ``(*B, d)`` each, as ``torch.distributions`` computes it."""
    each = -((action - loc) ** 2) / (2 * scale**2) - scale.log() - math.log(math.sqrt(2 * math.pi))
    return each.sum(-1)
