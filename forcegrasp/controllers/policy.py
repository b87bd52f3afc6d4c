"""The learned policy: a Gaussian over actions whose mean is a small tanh network of the stacked observation."""

from __future__ import annotations

from typing import cast

import torch
from tensordict.nn import AddStateIndependentNormalScale, TensorDictModule
from torch import Tensor, nn
from torchrl.modules import MLP, IndependentNormal, ProbabilisticActor

from forcegrasp.config import ObservationConfig, PPOConfig
from forcegrasp.physics.gripper import Gripper
from forcegrasp.physics.gripper_file import default_gripper


class Mirrored(nn.Module):
    """Averages a network with its own mirror image: with left and right swapped at its input and back at its output.

    The gripper is its own mirror image. A policy that is too treats both fingers alike, and can't push the
    object steadily to one side.

    Args:
      net: ``(*B, 2k) -> (*B, 2)``, where inputs and outputs are pairs (left, right).
    """

    def __init__(self, net: nn.Module) -> None:
        super().__init__()
        self.net = net

    def forward(self, observation: Tensor) -> Tensor:
        """Both actions, ``(*B, 2)``."""
        swapped = observation.unflatten(-1, (-1, 2)).flip(-1).flatten(-2)
        own, mirrored = self.net(torch.stack([observation, swapped])).unbind(0)
        return (own + mirrored.flip(-1)) / 2


def observation_size(gripper: Gripper, config: ObservationConfig) -> int:
    """Length of the stacked observation: a part has a number per motor, or one per force reading."""
    of_motors = {"position", "last_action"}
    sizes = [len(gripper.motors if part in of_motors else gripper.forces) for part in config.parts]
    return sum(sizes) * config.frames


def make_policy(observation_size: int, config: PPOConfig, gripper: Gripper | None = None) -> ProbabilisticActor:
    """Reads ``observation`` ``(*B, observation_size)``, writes ``action`` ``(*B, motors)`` and ``action_log_prob``.

    The standard deviation does not depend on the state. Actions are not squashed: the environment clips them to
    [−1, 1] (paper, Sec. 4).

    Args:
      observation_size: length of the stacked observation.
      config: size of the network, initial mean and deviation, and whether it is :class:`Mirrored`.
      gripper: how many motors there are, and whether it is its own mirror image; the paper's by default.
    """
    gripper = gripper or default_gripper()
    actions = len(gripper.motors)
    net = MLP(
        in_features=observation_size, out_features=actions, num_cells=list(config.hidden), activation_class=nn.Tanh
    )
    last = cast(nn.Linear, net[-1])
    nn.init.orthogonal_(last.weight, gain=0.01)
    nn.init.constant_(last.bias, config.initial_action)
    mean = Mirrored(net) if config.mirrored and gripper.is_symmetric else net
    scale = AddStateIndependentNormalScale(actions, init_value=config.log_std)
    return ProbabilisticActor(
        TensorDictModule(nn.Sequential(mean, scale), in_keys=["observation"], out_keys=["loc", "scale"]),
        in_keys=["loc", "scale"],
        distribution_class=IndependentNormal,
        return_log_prob=True,
    )
