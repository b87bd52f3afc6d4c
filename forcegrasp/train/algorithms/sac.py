"""Soft actor-critic (Haarnoja et al. 2018): learns from transitions of many batches, kept in a replay buffer."""

from __future__ import annotations

import logging
from typing import ClassVar, cast

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor
from torchrl.data import LazyTensorStorage, TensorDictReplayBuffer
from torchrl.envs import TransformedEnv
from torchrl.objectives import SACLoss, SoftUpdate

from forcegrasp.config import TrainConfig
from forcegrasp.physics.gripper import Gripper
from forcegrasp.train.algorithms.base import Algorithm, part_of
from forcegrasp.train.algorithms.value_network import make_action_value

#: What an update reports, by the names of torchrl's loss.
DIAGNOSTICS = ("loss_actor", "loss_qvalue", "alpha", "entropy")
#: The part of the loss that is the policy, which a checkpoint has already.
_POLICY = "actor_network_params."


class SAC(Algorithm):
    """SAC with two value networks and a learned weight of the entropy; the deviation does not depend on the state.

    Attributes:
      buffer: the newest transitions.
    """

    CHARTS: ClassVar = {
        "SAC health": {
            "entropy": ("sac/entropy",),
            "weight of the entropy": ("sac/alpha",),
            "losses": ("sac/loss_actor", "sac/loss_qvalue"),
            "transitions kept": ("sac/buffer",),
        }
    }
    ADVICE = """`entropy` should come to the motors' number times `sac.entropy_target`, and `alpha`, its weight, settle;
  `loss_actor` is about minus the value, so it falls as the policy improves; `buffer` counts the transitions kept"""

    NETWORKS = ("policy.", "loss.qvalue", "loss.target_qvalue")
    DRAWS = True

    def __init__(self, config: TrainConfig, env: TransformedEnv, gripper: Gripper) -> None:
        super().__init__(config, env, gripper)
        self.config = options = config.sac
        size = env.observation_spec["observation"].shape[-1]
        value = make_action_value(size, options, gripper).to(env.device)
        self.loss = SACLoss(
            self.policy,
            value,
            alpha_init=options.entropy_weight,
            target_entropy=options.entropy_target * len(gripper.motors),
            loss_function="l2",
        )
        self.loss.make_value_estimator(gamma=options.discount)
        self.targets = SoftUpdate(self.loss, tau=options.target_rate)
        self.optimizer = torch.optim.Adam(self.loss.parameters(), lr=options.learning_rate, fused=True)
        seen = {"observation", *value.in_keys}  # action among them
        after = {*seen, "reward", "done", "terminated"} - {"action"}
        self.keys = [*sorted(seen), *(("next", key) for key in sorted(after))]
        logging.getLogger("torchrl").setLevel(logging.WARNING)  # it reports each storage
        storage = LazyTensorStorage(options.buffer, device=cast(torch.device, env.device))
        self.buffer = TensorDictReplayBuffer(storage=storage, batch_size=options.minibatch)

    def set_progress(self, share: float) -> None:
        """Nothing is scheduled."""

    def update(self, batch: TensorDictBase) -> dict[str, float]:
        """Keeps a batch ``(n, T)``, and improves all networks on transitions drawn from those kept; returns means of
        the loss's diagnostics, the policy's deviation and how many transitions are kept.
        """
        self.buffer.extend(batch.select(*self.keys).reshape(-1)[-self.config.buffer :])
        sums = dict.fromkeys(DIAGNOSTICS, torch.zeros(()))
        for _ in range(self.config.updates):
            losses = self.loss(self.buffer.sample())
            self.optimizer.zero_grad(set_to_none=True)
            (losses["loss_actor"] + losses["loss_qvalue"] + losses["loss_alpha"]).backward()
            self.optimizer.step()
            self.targets.step()
            sums = {name: total + losses[name].detach() for name, total in sums.items()}
        return {
            **{name: float(total) / self.config.updates for name, total in sums.items()},
            "action_std": float(batch["scale"].mean()),
            "buffer": float(len(self.buffer)),
        }

    def state_dict(self) -> dict[str, Tensor]:
        tensors = super().state_dict()
        tensors |= {f"loss.{k}": v for k, v in self.loss.state_dict().items() if not k.startswith(_POLICY)}
        if len(self.buffer):
            kept = self.buffer[:].select(*self.keys).flatten_keys("/")
            tensors |= {f"buffer.{key}": value for key, value in kept.items()}
        cursor = torch.tensor(self.buffer.writer.state_dict()["_cursor"])
        # drawn with by the learner, which is not where the collector's generator is if Ray collects
        return tensors | {"cursor": cursor, "rng.learner": torch.get_rng_state()}

    def load_state_dict(self, tensors: dict[str, Tensor]) -> None:
        super().load_state_dict(tensors)
        policy = {k: v for k, v in self.loss.state_dict().items() if k.startswith(_POLICY)}
        self.loss.load_state_dict(policy | part_of(tensors, "loss."))
        self.buffer.empty()
        if kept := part_of(tensors, "buffer."):
            self.buffer.extend(TensorDict(kept, len(kept["action"])).unflatten_keys("/"))
        self.buffer.writer.load_state_dict({"_cursor": int(tensors["cursor"])})
        torch.set_rng_state(tensors["rng.learner"])
