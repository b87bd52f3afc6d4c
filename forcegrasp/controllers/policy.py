"""The learned policy: a Gaussian over actions whose mean is a small tanh network of the stacked observation."""

from __future__ import annotations

import torch
from tensordict.nn import AddStateIndependentNormalScale, TensorDictModule
from torch import Tensor, nn
from torchrl.modules import MLP, IndependentNormal, ProbabilisticActor

from forcegrasp.config import PPOConfig

FINGERS = 2


class MirroredFingers(nn.Module):
    """One network for both fingers. The left one sees the observation as it is, the right one with sides swapped.

    The gripper is its own mirror image; a policy that is too can't push the object steadily to one side.

    Args:
      net: ``(*B, observation) -> (*B, 1)``, one finger's action from its own view.
    """

    def __init__(self, net: nn.Module) -> None:
        super().__init__()
        self.net = net

    def forward(self, observation: Tensor) -> Tensor:
        """Every part of the observation is a pair (left, right), ``(*B, 2k)``; returns both actions, ``(*B, 2)``."""
        swapped = observation.unflatten(-1, (-1, FINGERS)).flip(-1).flatten(-2)
        return self.net(torch.stack([observation, swapped], dim=-2)).squeeze(-1)


def make_policy(observation_size: int, config: PPOConfig) -> ProbabilisticActor:
    """Reads ``observation`` ``(*B, observation_size)``, writes ``action`` ``(*B, 2)`` and ``action_log_prob``.

    The standard deviation does not depend on the state. Actions are not squashed: the environment clips them to
    [−1, 1] (paper, Sec. 4).

    Args:
      observation_size: length of the stacked observation.
      config: size of the network, initial mean and deviation, and whether it is :class:`MirroredFingers`.
    """
    outputs = 1 if config.mirrored else FINGERS
    net = MLP(
        in_features=observation_size, out_features=outputs, num_cells=list(config.hidden), activation_class=nn.Tanh
    )
    nn.init.orthogonal_(net[-1].weight, gain=0.01)
    nn.init.constant_(net[-1].bias, config.initial_action)
    mean = MirroredFingers(net) if config.mirrored else net
    scale = AddStateIndependentNormalScale(FINGERS, init_value=config.log_std)
    return ProbabilisticActor(
        TensorDictModule(nn.Sequential(mean, scale), in_keys=["observation"], out_keys=["loc", "scale"]),
        in_keys=["loc", "scale"],
        distribution_class=IndependentNormal,
        return_log_prob=True,
    )
