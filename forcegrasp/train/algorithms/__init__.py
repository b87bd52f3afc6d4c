"""Learning algorithms, one per file; a training runs the one whose options ``config.algorithm`` has."""

from __future__ import annotations

from forcegrasp.config import AlgorithmConfig, PPOConfig, TrainConfig
from forcegrasp.train.algorithms.base import Algorithm
from forcegrasp.train.algorithms.ppo import PPO

ALGORITHMS: dict[type[AlgorithmConfig], type[Algorithm]] = {PPOConfig: PPO}


def algorithm_of(config: TrainConfig) -> type[Algorithm]:
    """The algorithm that a configuration trains with."""
    return ALGORITHMS[type(config.algorithm)]


__all__ = ["ALGORITHMS", "PPO", "Algorithm", "algorithm_of"]
