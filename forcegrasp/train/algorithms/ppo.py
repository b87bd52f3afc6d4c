"""Proximal policy optimisation (Schulman et al. 2017): updates of the policy and the value network on a batch."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
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
from forcegrasp.train.algorithms.ppo_objective import Objective, entropy
from forcegrasp.train.algorithms.teacher import Teacher
from forcegrasp.train.algorithms.value_network import Value, make_value
from forcegrasp.train.algorithms.written_gradient import WrittenGradient, can_be_written


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


def one_gradient(parameters: Iterable[nn.Parameter]) -> Tensor:
    """A vector of which each parameter's ``grad`` is a part from now on: all are scaled by one operation."""
    parameters = list(parameters)
    sizes = [parameter.numel() for parameter in parameters]
    whole = torch.zeros(sum(sizes), device=parameters[0].device, dtype=parameters[0].dtype)
    for parameter, part in zip(parameters, whole.split(sizes), strict=True):
        parameter.grad = part.view_as(parameter)
    return whole


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
        self.advantage = GAE(gamma=options.discount, lmbda=options.gae_lambda, value_network=None)
        self.optimizer = torch.optim.Adam(
            [*self.policy.parameters(), *self.value.parameters()], lr=options.learning_rate, eps=1e-5, fused=True
        )
        self.objective = Objective(options, self.critic.horizon)
        self.teacher = Teacher(gripper, options.teacher_feedback) if options.teacher_weight else None

    def set_progress(self, share: float) -> None:
        """Lowers the learning rate and the teacher's weight linearly; ``share`` of the training is over."""
        left = 1 - (1 - self.config.teacher_weight_end) * min(max(share, 0.0), 1.0)
        self.objective.teacher_weight = self.config.teacher_weight * left
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
        """Writes what is learned from: ``advantage``, ``value_target``, ``true_state`` for a privileged critic, the
        teacher's answers, ``action_log_prob``.

        Of a batch that was collected ahead the policy has moved on since. So the ratio that is clipped is that to the
        policy as it is now, and an advantage counts by how much likelier its action is now than it was then (decoupled
        objective, Hilton et al. 2022).
        """
        self._value(batch)
        self.advantage(batch)
        if self.teacher:
            self.teacher.label(batch)
        advantage, then = batch["advantage"], batch["action_log_prob"]
        now = log_prob(batch["action"], *self.gaussian(batch))
        normal = (advantage - advantage.mean()) / (advantage.std() + 1e-8)
        batch["advantage"], batch["action_log_prob"] = normal * (now - then).exp().unsqueeze(-1), now

    def _value(self, batch: TensorDictBase) -> None:
        """Writes the values of all states, and ``true_state``: within an episode each step leads to the next state."""
        after, keys = cast(TensorDictBase, batch["next"]), cast("list[str]", self.value.in_keys)
        observation, *state = (torch.cat([batch[key], after[key][:, -1:]], 1) for key in keys)
        true_state = self.critic.true_state(*state) if state else None
        value = self.critic.of_seen(observation, true_state)
        batch["state_value"], batch["next", "state_value"] = value[:, :-1], value[:, 1:]
        if true_state is not None:
            batch["true_state"] = true_state[:, :-1]

    def learn(self, batch: TensorDictBase) -> dict[str, float]:
        """The passes over a batch that is prepared, minibatch by minibatch; returns what :meth:`update` does."""
        frames, size = self.samples(batch)
        slopes = [one_gradient(net.parameters()) for net in (self.policy, self.value)]
        written = can_be_written(self.policy, self.critic)
        gradient = WrittenGradient(self.policy, self.critic, self.objective) if written else self.gradient
        sums: dict[str, Tensor] = {}
        updates = 0
        for _ in range(self.config.epochs):
            order = torch.randperm(len(frames), generator=self.shuffle, device=self.shuffle.device)
            for ids in order.split(size):
                for slope in slopes:
                    slope.zero_()
                told = gradient(frames[ids])
                for slope in slopes:
                    slope *= (self.config.max_grad_norm / (torch.linalg.vector_norm(slope) + 1e-6)).clamp_max(1.0)
                self.optimizer.step()
                updates += 1
                sums = {name: sums.get(name, 0) + value for name, value in told.items()}
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
        valued = ("observation", "true_state") if self.critic.is_privileged else ("observation",)
        return list(dict.fromkeys((*self.policy.in_keys, *valued, *learned, *taught)))

    def gradient(self, frames: Any) -> dict[str, Tensor]:
        """Adds to each parameter's ``grad`` that of a minibatch, by autograd; returns the objective's parts."""
        loc, scale = self.gaussian(frames)
        log_ratio = log_prob(frames["action"], loc, scale).flatten() - frames["action_log_prob"].flatten()
        value = self.critic.of_seen(frames["observation"], frames.get("true_state"))
        objective, told = self.objective(frames, loc, scale, log_ratio, value)
        objective.backward()
        return {name: part.detach() for name, part in told.items()}

    def state_dict(self) -> dict[str, Tensor]:
        tensors = super().state_dict() | {f"value.{k}": v for k, v in self.value.state_dict().items()}
        return tensors | {"rng.shuffle": self.shuffle.get_state()}

    def load_state_dict(self, tensors: dict[str, Tensor]) -> None:
        super().load_state_dict(tensors)
        self.value.load_state_dict(part_of(tensors, "value."))
        self.shuffle.set_state(tensors["rng.shuffle"])

    @property
    def critic(self) -> Value:
        """The value network itself."""
        return cast(Value, self.value.module)
