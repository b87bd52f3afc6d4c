"""Networks of another training to begin with, refused where they would mean something else here."""

from __future__ import annotations

import dataclasses
from typing import Any

from torch import Tensor

from forcegrasp.config import TrainConfig
from forcegrasp.errors import ConfigError
from forcegrasp.physics import load_gripper
from forcegrasp.runs.policy import read_trained

#: Options of the algorithm that a network is made by; the others say how it learns.
NETWORK = ("hidden", "memory", "mirrored", "squeeze_together")


def read_start(config: TrainConfig) -> dict[str, Tensor]:
    """The checkpoint that ``config.start`` names.

    Raises:
      CheckpointError: if there is none, or it can't be read.
      ConfigError: if gripper, observation or network differ; it says which option, and what it would have to be.
    """
    tensors, trained = read_trained(config.start)
    there, here = (_network_options(one) for one in (trained, config))
    if differing := [f"{name}={_typed(value)}" for name, value in there.items() if here.get(name) != value]:
        raise ConfigError(f"start={config.start}: was trained with {' '.join(differing)}; add that, or start elsewhere")
    return tensors


def _network_options(config: TrainConfig) -> dict[str, Any]:
    """What a policy's inputs, outputs and weights mean, by the options' names."""
    algorithm = dataclasses.asdict(config.algorithm)
    return {
        "gripper": load_gripper(config.gripper).name,
        "learner": config.learner,
        "observation.parts": config.observation.parts,
        "observation.frames": config.observation.frames,
        **{f"{config.algorithm.name}.{name}": algorithm[name] for name in NETWORK if name in algorithm},
    }


def _typed(value: Any) -> str:
    """As one types it."""
    return str(value).replace(" ", "").replace("'", "")
