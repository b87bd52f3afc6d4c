"""The network of a policy's mean action, and what makes it symmetric or lets the fingers squeeze alike."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import accumulate
from typing import cast

import torch
from torch import Tensor, nn
from torchrl.modules import MLP

from forcegrasp.config import AlgorithmConfig
from forcegrasp.controllers.tanh import Tanh
from forcegrasp.physics.gripper import Gripper

#: Largest action that a squashed policy starts with: 1 is out of its reach.
_MOST = 0.99


class Mirror(nn.Module):
    """An observation's mirror image, with left and right swapped.

    Args:
      sizes: of the observation's parts in their order: 2 for a pair, 1 for a number that is the same in the mirror.
    """

    order: Tensor

    def __init__(self, sizes: Sequence[int]) -> None:
        super().__init__()
        starts = accumulate(sizes, initial=0)
        order = [start + k for start, size in zip(starts, sizes, strict=False) for k in reversed(range(size))]
        self.register_buffer("order", torch.tensor(order), persistent=False)

    def forward(self, observation: Tensor) -> Tensor:
        """``(*B, size) -> (*B, size)``."""
        return observation.index_select(-1, self.order)


class Mirrored(nn.Module):
    """Averages a network with its own mirror image: with left and right swapped at its input and back at its output.

    The gripper is its own mirror image. A policy that is too treats both fingers alike, and can't push the
    object steadily to one side.

    Args:
      net: ``(*B, size) -> (*B, 2)``; its output is the pair (left, right).
      sizes: of the observation's parts, see :class:`Mirror`.
    """

    def __init__(self, net: nn.Module, sizes: Sequence[int]) -> None:
        super().__init__()
        self.net, self.mirror = net, Mirror(sizes)

    def forward(self, observation: Tensor) -> Tensor:
        """Both actions, ``(*B, 2)``."""
        own, mirrored = self.net(torch.stack([observation, self.mirror(observation)])).unbind(0)
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
        return torch.where(self.grasped(observation), action.mean(-1, keepdim=True), action)

    def grasped(self, observation: Tensor) -> Tensor:
        """Whether every reading has shown contact, ``(*B, 1)``."""
        return (observation[..., self.contact] > 0.5).all(-1, keepdim=True)


def make_mean(
    sizes: Sequence[int], config: AlgorithmConfig, gripper: Gripper, contact: Sequence[int], squashed: bool = False
) -> nn.Module:
    """``(*B, sum(sizes)) -> (*B, motors)``, as it starts: about ``initial_action`` whatever is observed.

    Args:
      sizes: of the parts of what it sees.
      config: size of the network, initial action, and whether it is :class:`Mirrored`.
      gripper: how many motors there are, and whether it is its own mirror image.
      contact: where the newest frame has ``had_contact``, if the motors are to :class:`SqueezeTogether`.
      squashed: whether the action is the tangens hyperbolicus of what comes out.
    """
    actions = len(gripper.motors)
    net = MLP(in_features=sum(sizes), out_features=actions, num_cells=list(config.hidden), activation_class=Tanh)
    last = cast(nn.Linear, net[-1])
    nn.init.orthogonal_(last.weight, gain=0.01)
    initial = config.initial_action
    if squashed:
        initial = math.atanh(max(min(initial, _MOST), -_MOST))
    nn.init.constant_(last.bias, initial)
    mean = Mirrored(net, sizes) if config.mirrored and gripper.is_symmetric else net
    return SqueezeTogether(mean, contact) if contact else mean
