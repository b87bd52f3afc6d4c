"""Loads a trained policy from its run directory."""

from __future__ import annotations

from pathlib import Path

from tensordict.nn import TensorDictModuleBase

from forcegrasp.config import TrainConfig
from forcegrasp.controllers.policy import make_policy
from forcegrasp.errors import CheckpointError
from forcegrasp.runs.run_dir import RunDir


def load_policy(path: Path | str) -> tuple[TensorDictModuleBase, TrainConfig]:
    """Returns the newest policy of a run, and the configuration it was trained with.

    Raises:
      CheckpointError: if the directory is no run, or its newest checkpoint is of another configuration.
    """
    run = RunDir.open(path)
    config = run.config()
    tensors, _ = run.load()
    size = 2 * len(config.observation.parts) * config.observation.frames
    policy = make_policy(size, config.ppo)
    weights = {name.removeprefix("policy."): t for name, t in tensors.items() if name.startswith("policy.")}
    try:
        policy.load_state_dict(weights)
    except RuntimeError as error:
        raise CheckpointError(f"{path}: the checkpoint's weights do not fit its config.yaml") from error
    return policy.eval(), config
