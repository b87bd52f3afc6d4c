"""Proximal policy optimisation (Schulman et al. 2017): the loss, and one pass of updates over a batch."""

from __future__ import annotations

import math
from typing import Any, ClassVar, cast

import torch
from tensordict import TensorDictBase
from torch import Tensor, nn
from torchrl.envs import TransformedEnv
from torchrl.objectives import ClipPPOLoss
from torchrl.objectives.value import GAE

from forcegrasp.config import TrainConfig
from forcegrasp.physics.gripper import Gripper
from forcegrasp.train.algorithms.base import Algorithm, part_of
from forcegrasp.train.algorithms.teacher import Teacher, imitation_loss
from forcegrasp.train.algorithms.value_network import Value, make_value

#: What an update reports, by the names of torchrl's loss.
DIAGNOSTICS = ("loss_objective", "loss_critic", "kl_approx", "clip_fraction", "ESS")


def entropy(scale: Tensor) -> Tensor:
    """Mean differential entropy of the policy's Gaussian, in nats, from its standard deviations ``(*B, motors)``."""
    return (scale.log() + 0.5 * math.log(2 * math.pi * math.e)).sum(-1).mean()


class PPO(Algorithm):
    """Clipped PPO with generalised advantages, on batches of whole episodes.

    Attributes:
      value: the value network.
      shuffle: the generator that minibatches are drawn with.
    """

    CHARTS: ClassVar = {
        "PPO health": {
            "KL divergence": ("ppo/kl_approx",),
            "clip fraction": ("ppo/clip_fraction",),
            "entropy": ("ppo/entropy",),
            "losses": ("ppo/loss_objective", "ppo/loss_critic"),
        }
    }
    ADVICE = """in trainings that went well `kl_approx` stayed below 0.02 and `clip_fraction` below 0.2 (0.06 and
  0.35 with `budget=quick`); `action_std` and `entropy` fall as the policy makes up its mind; `ESS` is the effective
  share of a minibatch"""

    def __init__(self, config: TrainConfig, env: TransformedEnv, gripper: Gripper) -> None:
        super().__init__(config, env, gripper)
        self.config = options = config.ppo
        size = env.observation_spec["observation"].shape[-1]
        self.value = make_value(size, options, gripper).to(env.device)
        self.shuffle = torch.Generator(env.device).manual_seed(config.seed)
        self.advantage = GAE(gamma=options.discount, lmbda=options.gae_lambda, value_network=self.value)
        self.loss = ClipPPOLoss(
            self.policy,
            self.value,
            clip_epsilon=options.clip,
            entropy_bonus=options.entropy_weight > 0,
            entropy_coeff=options.entropy_weight,
            critic_coeff=options.value_weight,
            loss_critic_type="l2",
            normalize_advantage=False,
        )
        self.optimizer = torch.optim.Adam(
            [*self.policy.parameters(), *self.value.parameters()], lr=options.learning_rate, eps=1e-5, fused=True
        )
        self.teacher = Teacher(gripper, options.teacher_feedback) if options.teacher_weight else None
        self.teacher_weight = options.teacher_weight

    def set_progress(self, share: float) -> None:
        """Lowers the learning rate and the teacher's weight linearly; ``share`` of the training is over."""
        left = 1 - (1 - self.config.teacher_weight_end) * min(max(share, 0.0), 1.0)
        self.teacher_weight = self.config.teacher_weight * left
        rate = self.config.learning_rate * (1 - (1 - self.config.learning_rate_end) * min(max(share, 0.0), 1.0))
        for group in self.optimizer.param_groups:
            group["lr"] = rate

    def update(self, batch: TensorDictBase) -> dict[str, float]:
        """Improves both networks on a batch ``(n, T)`` of whole episodes; returns means of the loss's diagnostics, the
        learning rate, and standard deviation and entropy of the policy that collected.
        """
        with torch.no_grad():
            self.advantage(batch)
            if self.teacher:
                self.teacher.label(batch)
        learned = ("action", "action_log_prob", "advantage", "value_target")
        taught = ("taught_action", "taught_unit") if self.teacher else ()
        seen = cast(Any, [*self.policy.in_keys, *self.value.in_keys])
        frames, size = self.samples(batch.select(*seen, *learned, *taught))
        advantage = frames["advantage"]
        frames["advantage"] = (advantage - advantage.mean()) / (advantage.std() + 1e-8)
        reported = (*DIAGNOSTICS, "loss_teacher") if self.teacher else DIAGNOSTICS
        sums = dict.fromkeys(reported, torch.zeros(()))
        updates = 0
        for _ in range(self.config.epochs):
            order = torch.randperm(len(frames), generator=self.shuffle, device=self.shuffle.device)
            for ids in order.split(size):
                minibatch = frames[ids]
                losses = self.loss(minibatch)
                # value errors in units of the horizon: in units of reward they would drown the policy's
                objective = losses["loss_objective"] + losses["loss_critic"] / self.horizon**2
                if self.config.entropy_weight:
                    objective = objective + losses["loss_entropy"]
                if self.teacher:
                    action = self.policy[0](minibatch.select(*cast(Any, self.policy.in_keys)))["loc"]
                    losses["loss_teacher"] = imitation_loss(action, minibatch, self.config.teacher_caution)
                    objective = objective + self.teacher_weight * losses["loss_teacher"]
                self.optimizer.zero_grad(set_to_none=True)
                objective.backward()
                for net in (self.policy, self.value):
                    nn.utils.clip_grad_norm_(net.parameters(), self.config.max_grad_norm)
                self.optimizer.step()
                updates += 1
                sums = {name: total + losses[name].detach().mean() for name, total in sums.items()}
        return {
            **{name: float(total) / updates for name, total in sums.items()},
            "learning_rate": self.optimizer.param_groups[0]["lr"],
            "action_std": float(batch["scale"].mean()),
            "entropy": float(entropy(batch["scale"])),
        }

    def samples(self, batch: TensorDictBase) -> tuple[TensorDictBase, int]:
        """What minibatches of a batch ``(n, T)`` are drawn from, and of how many of these they are."""
        return batch.reshape(-1), self.config.minibatch

    def state_dict(self) -> dict[str, Tensor]:
        tensors = super().state_dict() | {f"value.{k}": v for k, v in self.value.state_dict().items()}
        for index, moments in self.optimizer.state_dict()["state"].items():
            tensors |= {f"optimizer.{index}.{k}": v for k, v in moments.items()}
        return tensors | {"rng.shuffle": self.shuffle.get_state()}

    def load_state_dict(self, tensors: dict[str, Tensor]) -> None:
        super().load_state_dict(tensors)
        self.value.load_state_dict(part_of(tensors, "value."))
        optimizer = self.optimizer.state_dict()
        for key, value in part_of(tensors, "optimizer.").items():
            index, moment = key.split(".")
            optimizer["state"].setdefault(int(index), {})[moment] = value
        self.optimizer.load_state_dict(optimizer)
        self.shuffle.set_state(tensors["rng.shuffle"])

    @property
    def horizon(self) -> float:
        return cast(Value, self.value.module).horizon
