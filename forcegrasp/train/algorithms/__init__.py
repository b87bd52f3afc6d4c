"""Learning algorithms, one per file; a training runs the one that its options name."""

from __future__ import annotations

from forcegrasp.config import TrainConfig
from forcegrasp.train.algorithms.base import Algorithm
from forcegrasp.train.algorithms.ppo import PPO
from forcegrasp.train.algorithms.recurrent_ppo import RecurrentPPO
from forcegrasp.train.algorithms.sac import SAC


def algorithm_of(config: TrainConfig) -> type[Algorithm]:
    """The algorithm that a configuration trains with."""
    if config.learner == "sac":
        return SAC
    return RecurrentPPO if config.ppo.memory else PPO


__all__ = ["PPO", "SAC", "Algorithm", "RecurrentPPO", "algorithm_of"]
