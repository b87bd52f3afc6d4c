"""What a training asks of the algorithm that learns."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

import torch
from tensordict import TensorDictBase
from torch import Tensor
from torchrl.envs import TransformedEnv

from forcegrasp.config import TrainConfig
from forcegrasp.controllers.policy import policy_of
from forcegrasp.errors import CheckpointError
from forcegrasp.physics.gripper import Gripper

#: How the policy's standard deviation is named.
DEVIATION = "state_independent_scale"


class Algorithm(ABC):
    """Improves a policy on batches of whole episodes, which others collect with it.

    Attributes:
      policy: what acts while training, and what is evaluated and exported.
      total_frames: control steps to train for, over all grasps.
      frames_per_batch: grasps times steps of an episode.

    Args:
      config: the whole configuration, complete; ``config.algorithm`` are the options that every algorithm has.
      env: what is learned in.
      gripper: what grasps.
    """

    #: TensorBoard's page: title → chart → columns of metrics.csv, as ``NAME/metric``.
    CHARTS: ClassVar[dict[str, dict[str, tuple[str, ...]]]]
    #: How to read these metrics, as Markdown.
    ADVICE: ClassVar[str]
    #: Whether updates draw from torch's own generator, as collecting does: then the two take turns.
    DRAWS: ClassVar[bool] = False
    #: How the names of its networks begin in :meth:`state_dict`.
    NETWORKS: ClassVar[tuple[str, ...]] = ("policy.",)
    #: Of all that learns; its moments are saved.
    optimizer: torch.optim.Optimizer

    def __init__(self, config: TrainConfig, env: TransformedEnv, gripper: Gripper) -> None:
        self.total_frames = config.algorithm.total_frames
        self.frames_per_batch = config.algorithm.grasps * config.grasp.steps
        self.policy = policy_of(config, gripper)
        self.policy.to(env.device)

    @abstractmethod
    def set_progress(self, share: float) -> None:
        """Sets what is scheduled, such as the learning rate; ``share`` of the training is over."""

    @abstractmethod
    def update(self, batch: TensorDictBase) -> dict[str, float]:
        """Learns from a batch ``(n, T)`` of whole episodes; returns its metrics, the same ones each time."""

    def state_dict(self) -> dict[str, Tensor]:
        """All of its state that changes while training; the policy's is named ``policy.…``, by which it is loaded."""
        tensors = {f"policy.{k}": v for k, v in self.policy.state_dict().items()}
        for index, moments in self.optimizer.state_dict()["state"].items():
            tensors |= {f"optimizer.{index}.{k}": v for k, v in moments.items()}
        return tensors

    def load_state_dict(self, tensors: dict[str, Tensor]) -> None:
        """The inverse of :meth:`state_dict`; more entries do no harm.

        Raises:
          KeyError, RuntimeError: if these are not the tensors of such an algorithm.
        """
        self.policy.load_state_dict(part_of(tensors, "policy."))
        optimizer = self.optimizer.state_dict()
        for key, value in part_of(tensors, "optimizer.").items():
            index, moment = key.split(".")
            optimizer["state"].setdefault(int(index), {})[moment] = value
        self.optimizer.load_state_dict(optimizer)

    def begin_with(self, tensors: dict[str, Tensor]) -> None:
        """Takes over the networks of another training, where it has them and they are of this shape.

        The deviation stays that of the options: a policy that has learned explores too little to learn anew.

        Raises:
          CheckpointError: if the policy's weights are of another network.
        """
        own = self.state_dict()
        wanted = {k: v for k, v in own.items() if k.startswith(self.NETWORKS) and not k.endswith(DEVIATION)}
        taken = {k: tensors[k] for k, v in wanted.items() if k in tensors and tensors[k].shape == v.shape}
        if any(name.startswith("policy.") for name in wanted.keys() - taken.keys()):
            raise CheckpointError("start: its weights do not fit its config.yaml")
        self.load_state_dict(own | taken)


def part_of(tensors: dict[str, Tensor], prefix: str) -> dict[str, Tensor]:
    """The entries whose names begin so, without that beginning."""
    return {name.removeprefix(prefix): value for name, value in tensors.items() if name.startswith(prefix)}
