"""Proximal policy optimisation (Schulman et al. 2017): the loss, and one pass of updates over a batch."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, cast

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModule
from tensordict.utils import NestedKey
from torch import Tensor, nn
from torchrl.envs import TransformedEnv
from torchrl.objectives.value import GAE

from forcegrasp.config import TrainConfig
from forcegrasp.controllers.policy import log_prob
from forcegrasp.physics.gripper import Gripper
from forcegrasp.train.algorithms.base import Algorithm, part_of
from forcegrasp.train.algorithms.teacher import Teacher, imitation_loss
from forcegrasp.train.algorithms.value_network import Value, make_value


def clipped_loss(log_ratio: Tensor, advantage: Tensor, clip: float) -> dict[str, Tensor]:
    """The clipped surrogate (Schulman et al. 2017, eq. 7) and its diagnostics, as torchrl's ``ClipPPOLoss`` has them.

    Its tensordicts, and modules with parameters put into them, would take longer than these few numbers.

    Args:
      log_ratio: logarithm of the probability of each action now over that when it was taken, ``(n,)``.
      advantage: of each action, ``(n,)``.
      clip: ε.
    """
    clipped = log_ratio.clamp(math.log1p(-clip), math.log1p(clip))
    gain = torch.minimum(log_ratio.exp() * advantage, clipped.exp() * advantage)
    with torch.no_grad():
        effective = (2 * log_ratio.logsumexp(0) - (2 * log_ratio).logsumexp(0)).exp() / len(log_ratio)
        share = (clipped != log_ratio).float().mean()
        divergence = -log_ratio.mean()
    return {"loss_objective": -gain.mean(), "kl_approx": divergence, "clip_fraction": share, "ESS": effective}


class Frames:
    """Entries ``(*B, d)`` of a batch as rows of one matrix, so that a minibatch is one lookup.

    Args:
      batch: where they are.
      keys: which.
    """

    def __init__(self, batch: TensorDictBase, keys: Sequence[NestedKey]) -> None:
        entries = [batch.get(key) for key in keys]
        entries = [e.unsqueeze(-1) if e.ndim == batch.ndim else e for e in entries]
        self.sizes = {key: entry.shape[-1] for key, entry in zip(keys, entries, strict=True)}
        self.rows = torch.cat(entries, -1).flatten(0, -2)

    def __len__(self) -> int:
        return len(self.rows)

    def __getitem__(self, ids: Tensor) -> dict[NestedKey, Tensor]:
        """Entries ``(len(ids), d)`` of these frames."""
        return dict(zip(self.sizes, self.rows.index_select(0, ids).split(list(self.sizes.values()), -1), strict=True))


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
    NETWORKS = ("policy.", "value.")
    ADVICE = """in trainings that went well `kl_approx` stayed below 0.02 and `clip_fraction` below 0.2 (0.06 and
  0.35 with `budget=quick`); `action_std` and `entropy` fall as the policy makes up its mind; `ESS` is the effective
  share of a minibatch"""

    def __init__(self, config: TrainConfig, env: TransformedEnv, gripper: Gripper) -> None:
        super().__init__(config, env, gripper)
        self.config = options = config.ppo
        size = env.observation_spec["observation"].shape[-1]
        self.value = make_value(size, options, gripper).to(env.device)
        self.shuffle = torch.Generator(env.device).manual_seed(config.seed)
        # vmap would copy the states first
        self.advantage = GAE(
            gamma=options.discount, lmbda=options.gae_lambda, value_network=self.value, deactivate_vmap=True
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
        """Improves both networks on a batch ``(n, T)`` of whole episodes; returns means of the losses and of what tells
        how they go, the learning rate, and standard deviation and entropy of the policy that collected.
        """
        self.prepare(batch)
        return self.learn(batch)

    @torch.no_grad()
    def prepare(self, batch: TensorDictBase) -> None:
        """Writes what is learned from: ``advantage``, ``value_target``, the teacher's answers, ``action_log_prob``.

        Of a batch that was collected ahead the policy has moved on since. So the ratio that is clipped is that to the
        policy as it is now, and an advantage counts by how much likelier its action is now than it was then (decoupled
        objective, Hilton et al. 2022).
        """
        self.advantage(batch)
        if self.teacher:
            self.teacher.label(batch)
        advantage, then = batch["advantage"], batch["action_log_prob"]
        now = log_prob(batch["action"], *self.gaussian(batch))
        normal = (advantage - advantage.mean()) / (advantage.std() + 1e-8)
        batch["advantage"], batch["action_log_prob"] = normal * (now - then).exp().unsqueeze(-1), now

    def learn(self, batch: TensorDictBase) -> dict[str, float]:
        """The passes over a batch that is prepared, minibatch by minibatch; returns what :meth:`update` does."""
        frames, size = self.samples(batch)
        nets = [list(net.parameters()) for net in (self.policy, self.value)]
        sums: dict[str, Tensor] = {}
        updates = 0
        for _ in range(self.config.epochs):
            order = torch.randperm(len(frames), generator=self.shuffle, device=self.shuffle.device)
            for ids in order.split(size):
                objective, told = self._losses(frames[ids])
                self.optimizer.zero_grad(set_to_none=True)
                objective.backward()
                for parameters in nets:
                    nn.utils.clip_grad_norm_(parameters, self.config.max_grad_norm)
                self.optimizer.step()
                updates += 1
                sums = {name: sums.get(name, 0) + value.detach() for name, value in told.items()}
        return {
            **{name: float(total) / updates for name, total in sums.items()},
            "learning_rate": self.optimizer.param_groups[0]["lr"],
            "action_std": float(batch["scale"].mean()),
            "entropy": float(entropy(batch["scale"])),
        }

    def samples(self, batch: TensorDictBase) -> tuple[Any, int]:
        """What minibatches of a batch ``(n, T)`` are drawn from, as entries by name, and how many of these one has."""
        return Frames(batch, self.read), self.config.minibatch

    def gaussian(self, frames: Any) -> tuple[Tensor, Tensor]:
        """Mean and standard deviation of the policy's actions, ``(*B, motors)`` each."""
        return cast(TensorDictModule, self.policy[0]).module(frames["observation"])

    @property
    def read(self) -> list[NestedKey]:
        """The entries of a prepared batch that are learned from."""
        learned = ("action", "action_log_prob", "advantage", "value_target")
        taught = ("taught_action", "taught_unit") if self.teacher else ()
        return list(dict.fromkeys((*self.policy.in_keys, *self.value.in_keys, *learned, *taught)))

    def _losses(self, frames: Mapping[NestedKey, Tensor]) -> tuple[Tensor, dict[str, Tensor]]:
        """What a gradient step lowers on a minibatch, and its parts and diagnostics."""
        options = self.config
        loc, scale = self.gaussian(frames)
        value = self.value.module(*(frames[key] for key in self.value.in_keys))
        log_ratio = log_prob(frames["action"], loc, scale).flatten() - frames["action_log_prob"].flatten()
        told = clipped_loss(log_ratio, frames["advantage"].flatten(), options.clip)
        told["loss_critic"] = options.value_weight * (value - frames["value_target"]).square().mean()
        # value errors in units of the horizon: in units of reward they would drown the policy's
        objective = told["loss_objective"] + told["loss_critic"] / self.horizon**2
        if options.entropy_weight:
            objective = objective - options.entropy_weight * entropy(scale)
        if self.teacher:
            told["loss_teacher"] = imitation_loss(loc, frames, options.teacher_caution)
            objective = objective + self.teacher_weight * told["loss_teacher"]
        return objective, told

    def state_dict(self) -> dict[str, Tensor]:
        tensors = super().state_dict() | {f"value.{k}": v for k, v in self.value.state_dict().items()}
        return tensors | {"rng.shuffle": self.shuffle.get_state()}

    def load_state_dict(self, tensors: dict[str, Tensor]) -> None:
        super().load_state_dict(tensors)
        self.value.load_state_dict(part_of(tensors, "value."))
        self.shuffle.set_state(tensors["rng.shuffle"])

    @property
    def horizon(self) -> float:
        return cast(Value, self.value.module).horizon
