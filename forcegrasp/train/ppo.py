"""What PPO optimises: the value network, the loss, and one pass of updates over a batch."""

from __future__ import annotations

import math
from typing import cast

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModule
from torch import Tensor, nn
from torchrl.modules import MLP, ProbabilisticActor
from torchrl.objectives import ClipPPOLoss
from torchrl.objectives.value import GAE

from forcegrasp.config import PPOConfig
from forcegrasp.physics.gripper import Gripper
from forcegrasp.physics.gripper_file import default_gripper


class Value(nn.Module):
    """State value. Its output is scaled by the horizon 1 / (1 − γ), so that the network's own stays about 1."""

    middle: Tensor
    half_width: Tensor

    def __init__(
        self, observation_size: int, hidden: list[int], discount: float, privileged: bool, gripper: Gripper
    ) -> None:
        super().__init__()
        ranges = _parameter_ranges(gripper)
        self.direct, self.stroke, self.force = gripper.is_direct, gripper.stroke, _large_force(gripper)
        extra = len(ranges) + 2 + len(gripper.motors) + 1 if privileged else 0
        self.net = MLP(
            in_features=observation_size + extra, out_features=1, num_cells=list(hidden), activation_class=nn.Tanh
        )
        self.horizon = 1 / max(1 - discount, 1e-3)
        self.register_buffer("middle", torch.tensor([(low + high) / 2 for low, high in ranges]), persistent=False)
        half = [max((high - low) / 2, 1e-6) for low, high in ranges]
        self.register_buffer("half_width", torch.tensor(half), persistent=False)

    def forward(self, observation: Tensor, *state: Tensor) -> Tensor:
        if state:
            parameters, force, position, object_position = state
            true = (parameters - self.middle) / self.half_width
            moved = (object_position - parameters[..., 3:4]) * 1000
            features = [true, force / self.force, self._gap(position, object_position, parameters[..., 2:3]), moved]
            observation = torch.cat([observation, *features], dim=-1)
        return self.horizon * self.net(observation)

    def _gap(self, position: Tensor, object_position: Tensor, radius: Tensor) -> Tensor:
        """True gap between each finger and the object's surface, in centimetres; else where the motors are."""
        if not self.direct:
            return 2 * position / self.stroke - 1
        side = torch.tensor([-1.0, 1.0], device=position.device)
        return (position - side * object_position - radius) * 100


def _parameter_ranges(gripper: Gripper) -> list[tuple[float, float]]:
    """Where kappa, b2, radius, offset and goal force of a grasp usually lie, to bring them to about [-1, 1]."""
    training = gripper.training
    middle, depth = sum(training.offset_m) / 2, training.deformation_m
    offset = (middle - depth, middle + depth)
    return [(0.0, 1.0), training.servo_gain_range, training.radius_m, offset, (0.0, _large_force(gripper))]


def _large_force(gripper: Gripper) -> float:
    """Two thirds of the largest force of any object, newtons: few goals lie above."""
    training = gripper.training
    return training.max_force_n * max(float(training.force_scale(kappa)) for kappa in (0.0, 1.0)) / 3 * 2


#: What an update reports, by the names of torchrl's loss.
DIAGNOSTICS = ("loss_objective", "loss_critic", "kl_approx", "clip_fraction", "ESS")
PRIVILEGED = ["grasp_parameters", "force", "joint_position", "object_position"]


def make_value(observation_size: int, config: PPOConfig, gripper: Gripper | None = None) -> TensorDictModule:
    """The value network: reads ``observation`` (and the true state, if privileged), writes ``state_value``."""
    privileged = config.critic == "privileged"
    net = Value(observation_size, config.hidden, config.discount, privileged, gripper or default_gripper())
    return TensorDictModule(net, in_keys=["observation", *(PRIVILEGED if privileged else [])], out_keys=["state_value"])


def entropy(scale: Tensor) -> Tensor:
    """Mean differential entropy of the policy's Gaussian, in nats, from its standard deviations ``(*B, motors)``."""
    return (scale.log() + 0.5 * math.log(2 * math.pi * math.e)).sum(-1).mean()


class PPO:
    """Clipped PPO with generalised advantages, on batches of whole episodes.

    Args:
      policy, value: the networks.
      config: every number of the algorithm.
    """

    def __init__(self, policy: ProbabilisticActor, value: TensorDictModule, config: PPOConfig) -> None:
        self.config, self.policy, self.value = config, policy, value
        self.advantage = GAE(gamma=config.discount, lmbda=config.gae_lambda, value_network=value)
        self.loss = ClipPPOLoss(
            policy,
            value,
            clip_epsilon=config.clip,
            entropy_bonus=config.entropy_weight > 0,
            entropy_coeff=config.entropy_weight,
            critic_coeff=config.value_weight,
            loss_critic_type="l2",
            normalize_advantage=False,
        )
        self.optimizer = torch.optim.Adam(
            [*policy.parameters(), *value.parameters()], lr=config.learning_rate, eps=1e-5, fused=True
        )

    def set_progress(self, share: float) -> float:
        """Lowers the learning rate linearly; ``share`` of the training is over. Returns the rate."""
        rate = self.config.learning_rate * (1 - (1 - self.config.learning_rate_end) * min(max(share, 0.0), 1.0))
        for group in self.optimizer.param_groups:
            group["lr"] = rate
        return rate

    def update(self, batch: TensorDictBase, generator: torch.Generator) -> dict[str, float]:
        """Improves both networks on a batch ``(n, T)`` of whole episodes; returns the mean of each diagnostic."""
        with torch.no_grad():
            self.advantage(batch)
        frames = batch.select(*self.value.in_keys, "action", "action_log_prob", "advantage", "value_target").reshape(-1)
        advantage = frames["advantage"]
        frames["advantage"] = (advantage - advantage.mean()) / (advantage.std() + 1e-8)
        sums = dict.fromkeys(DIAGNOSTICS, torch.zeros(()))
        updates = 0
        for _ in range(self.config.epochs):
            order = torch.randperm(len(frames), generator=generator, device=generator.device)
            for ids in order.split(self.config.minibatch):
                losses = self.loss(frames[ids])
                # value errors in units of the horizon: in units of reward they would drown the policy's
                objective = losses["loss_objective"] + losses["loss_critic"] / self.horizon**2
                if self.config.entropy_weight:
                    objective = objective + losses["loss_entropy"]
                self.optimizer.zero_grad(set_to_none=True)
                objective.backward()
                for net in (self.policy, self.value):
                    nn.utils.clip_grad_norm_(net.parameters(), self.config.max_grad_norm)
                self.optimizer.step()
                updates += 1
                sums = {name: total + losses[name].detach() for name, total in sums.items()}
        return {name: float(total) / updates for name, total in sums.items()}

    @property
    def horizon(self) -> float:
        return cast(Value, self.value.module).horizon
