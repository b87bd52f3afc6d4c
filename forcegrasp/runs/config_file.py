"""A run's ``config.yaml``: every option of the training, as plain data."""

from __future__ import annotations

import functools
import hashlib
import json
from pathlib import Path
from typing import Any, cast

from omegaconf import OmegaConf
from omegaconf.errors import OmegaConfBaseException

from forcegrasp.config import TrainConfig, validate
from forcegrasp.errors import CheckpointError, ConfigError
from forcegrasp.files import plain_yaml
from forcegrasp.models.variation import read_model_of, with_noise_of
from forcegrasp.physics import load_gripper
from forcegrasp.physics.completion import complete

#: The model that a run trains in, beside its configuration.
MODEL = "model.yaml"


def fingerprint(options: dict[str, Any]) -> str:
    """Identifies a training by its options as config.yaml has them; checkpoints carry it.

    Options that came into being after the run was made are not among them, so that old runs stay readable.
    """
    return hashlib.sha256(json.dumps(options, sort_keys=True).encode()).hexdigest()[:16]


def read_config(path: Path) -> TrainConfig:
    """The options in a file, those that it leaves out from the defaults and the gripper's description.

    Raises:
      CheckpointError: if the file can't be read or holds unknown or invalid options.
    """
    loaded = read_options(path)
    try:
        _refuse_interpolations(loaded)
        merged = OmegaConf.merge(_schema(), loaded)
        config = cast(TrainConfig, OmegaConf.to_object(merged))
        validate(config)
        gripper, model_path = load_gripper(config.gripper), path.parent / MODEL
        model = read_model_of(gripper, model_path) if config.model and model_path.exists() else None
        return complete(config, with_noise_of(gripper, model))
    except (OSError, OmegaConfBaseException, ConfigError, ValueError) as error:
        raise _invalid(path, error) from error


def read_options(path: Path) -> dict[str, Any]:
    """The options in a file as they stand there.

    Raises:
      CheckpointError: if the file can't be read or holds none.
    """
    try:
        loaded = plain_yaml.load(path)
        if not isinstance(loaded, dict):  # text would be taken for more YAML
            raise ConfigError("no options in it")
    except (OSError, ConfigError, ValueError) as error:
        raise _invalid(path, error) from error
    return loaded


def _invalid(path: Path, error: Exception) -> CheckpointError:
    return CheckpointError(f"{path}: not a valid configuration ({str(error).strip().splitlines()[0]})")


@functools.cache  # to make it takes as long as to merge a file into it
def _schema() -> Any:
    return OmegaConf.structured(TrainConfig)


def _refuse_interpolations(options: dict[str, Any], path: str = "") -> None:
    """Raises ConfigError where a value asks for another one, such as a variable of the reader's environment."""
    for name, value in options.items():
        if isinstance(value, dict):
            _refuse_interpolations(value, f"{path}{name}.")
        elif "${" in str(value):
            raise ConfigError(f"{path}{name}={value}: ${{...}} is not replaced in a file; write the value itself")
