"""Loads a trained policy, from its run directory or from those that come with the package."""

from __future__ import annotations

from pathlib import Path

from torchrl.modules import ProbabilisticActor

from forcegrasp.config import TrainConfig
from forcegrasp.controllers.policy import make_policy
from forcegrasp.errors import CheckpointError
from forcegrasp.policies import FOLDER, shipped_policies
from forcegrasp.runs.run_dir import RunDir


def load_policy(name: Path | str) -> tuple[ProbabilisticActor, TrainConfig]:
    """Returns a shipped policy by name, or the newest policy of a run; and the configuration it was trained with.

    A shipped policy is laid out like a run directory, so that both are read alike.

    Raises:
      CheckpointError: if there is no such policy or run, or its newest checkpoint is of another configuration.
    """
    run = RunDir.open(FOLDER / str(name) if str(name) in shipped_policies() else name)
    config = run.config()
    tensors, _ = run.load()
    size = 2 * len(config.observation.parts) * config.observation.frames
    policy = make_policy(size, config.ppo)
    weights = {key.removeprefix("policy."): t for key, t in tensors.items() if key.startswith("policy.")}
    try:
        policy.load_state_dict(weights)
    except RuntimeError as error:
        raise CheckpointError(f"{name}: the checkpoint's weights do not fit its config.yaml") from error
    return policy.eval(), config
