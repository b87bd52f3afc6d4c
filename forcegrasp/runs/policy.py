"""Loads a trained policy, from its run directory or from those that come with the package."""

from __future__ import annotations

from pathlib import Path

from torch import Tensor
from torchrl.modules import ProbabilisticActor

from forcegrasp.config import TrainConfig
from forcegrasp.controllers.policy import policy_of
from forcegrasp.errors import CheckpointError
from forcegrasp.physics import load_gripper
from forcegrasp.policies import FOLDER, shipped_policies
from forcegrasp.runs.run_dir import RunDir


def load_policy(name: Path | str) -> tuple[ProbabilisticActor, TrainConfig]:
    """Returns a policy and the configuration it was trained with.

    The name is that of a shipped policy, a run directory for its newest checkpoint, or the path of a run's checkpoint.

    A shipped policy is laid out like a run directory, so that both are read alike.

    Raises:
      CheckpointError: if there is no such policy or run, or its checkpoint is of another configuration.
    """
    tensors, config = read_trained(name)
    policy = policy_of(config, load_gripper(config.gripper))
    weights = {key.removeprefix("policy."): t for key, t in tensors.items() if key.startswith("policy.")}
    try:
        policy.load_state_dict(weights)
    except RuntimeError as error:
        raise CheckpointError(f"{name}: the checkpoint's weights do not fit its config.yaml") from error
    return policy.eval(), config


def read_trained(name: Path | str) -> tuple[dict[str, Tensor], TrainConfig]:
    """Returns all that a checkpoint holds, and the configuration it was trained with. The name is as above.

    Raises:
      CheckpointError: if there is no such policy or run, or its checkpoint is of another configuration.
    """
    path = FOLDER / str(name) if str(name) in shipped_policies() else Path(name)
    one = path.suffix == ".safetensors"
    run = RunDir.open(path.parent.parent if one else path)
    config = run.config()
    return (run.load_file(path) if one else run.load())[0], config
