"""The learned policy: a Gaussian over actions whose mean is a small tanh network of the stacked observation."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import cast

from tensordict.nn import AddStateIndependentNormalScale, TensorDictModule
from torch import Tensor, nn
from torchrl.modules import IndependentNormal, ProbabilisticActor, TanhNormal

from forcegrasp.config import AlgorithmConfig, ObservationConfig, PPOConfig, SACConfig, TrainConfig
from forcegrasp.controllers.mean_network import make_mean
from forcegrasp.controllers.recurrent import RecurrentNetwork, RecurrentPolicy, make_recurrent_policy
from forcegrasp.errors import ConfigError
from forcegrasp.observation import PARTS
from forcegrasp.physics.gripper import Gripper
from forcegrasp.physics.gripper_file import default_gripper


def part_sizes(gripper: Gripper, config: ObservationConfig) -> list[int]:
    """How many numbers each part of the stacked observation has, in its order."""
    return [PARTS[part].size(len(gripper.motors), len(gripper.forces)) for part in config.parts] * config.frames


def policy_of(config: TrainConfig, gripper: Gripper) -> ProbabilisticActor:
    """The policy of a training, as it starts.

    Raises:
      ConfigError: if its motors are to squeeze together and it can't see when.
    """
    sizes, parts, options = part_sizes(gripper, config.observation), config.observation.parts, config.algorithm
    contact: Sequence[int] = ()
    if options.squeeze_together:
        if "had_contact" not in parts:
            raise ConfigError(f"{options.name}.squeeze_together: add had_contact to observation.parts")
        newest = len(sizes) - len(parts) + parts.index("had_contact")
        contact = range(sum(sizes[:newest]), sum(sizes[: newest + 1]))
    if isinstance(options, PPOConfig) and options.memory:
        return make_recurrent_policy(sizes, options, gripper, contact)
    return make_policy(sizes, options, gripper, contact)


def make_policy(
    sizes: Sequence[int], config: AlgorithmConfig, gripper: Gripper | None = None, contact: Sequence[int] = ()
) -> ProbabilisticActor:
    """Reads ``observation`` ``(*B, sum(sizes))``, writes ``action`` ``(*B, motors)`` and ``action_log_prob``.

    The standard deviation does not depend on the state. PPO's actions are not squashed: the environment clips them to
    [−1, 1] (paper, Sec. 4). SAC's are, as it asks the value networks about actions that nobody clips.

    Args:
      sizes: of the parts of the stacked observation, see :func:`part_sizes`.
      config: size of the network, initial mean and deviation, and whether it is mirrored.
      gripper: how many motors there are, and whether it is its own mirror image; the paper's by default.
      contact: where the newest frame has ``had_contact``, if the motors are to squeeze together.
    """
    gripper, squashed = gripper or default_gripper(), isinstance(config, SACConfig)
    mean = make_mean(sizes, config, gripper, contact, squashed)
    scale = AddStateIndependentNormalScale(len(gripper.motors), init_value=config.log_std)
    return ProbabilisticActor(
        TensorDictModule(nn.Sequential(mean, scale), in_keys=["observation"], out_keys=["loc", "scale"]),
        in_keys=["loc", "scale"],
        distribution_class=TanhNormal if squashed else IndependentNormal,
        return_log_prob=True,
    )


def log_prob(action: Tensor, loc: Tensor, scale: Tensor) -> Tensor:
    """Logarithm of the density of independent Gaussians, ``(*B, d)`` each, as ``torch.distributions`` computes it."""
    each = -((action - loc) ** 2) / (2 * scale**2) - scale.log() - math.log(math.sqrt(2 * math.pi))
    return each.sum(-1)


def network_of(policy: ProbabilisticActor) -> nn.Module:
    """The mean action as a function of the observation, and of the memory if the policy has one: what is exported."""
    if isinstance(policy, RecurrentPolicy):
        return RecurrentNetwork(policy)
    mean = cast(nn.Sequential, policy[0].module)[0]
    return nn.Sequential(mean, nn.Tanh()) if policy[1].distribution_class is TanhNormal else mean
