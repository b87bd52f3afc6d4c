"""Options that were left out, completed from the gripper's description."""

from __future__ import annotations

import copy
import dataclasses
from typing import Any, TypeVar

from forcegrasp.config import is_left_out
from forcegrasp.physics.gripper import Gripper

Config = TypeVar("Config")


def complete(config: Config, gripper: Gripper) -> Config:
    """Returns a copy of a config dataclass whose left-out options are the gripper's."""
    config = copy.deepcopy(config)
    _fill(config, gripper)
    return config


def _fill(config: Any, gripper: Gripper) -> None:
    for entry in dataclasses.fields(config):
        value, name = getattr(config, entry.name), entry.metadata.get("of_gripper", "")
        if dataclasses.is_dataclass(value):
            _fill(value, gripper)
        elif name and is_left_out(value):
            source = gripper if hasattr(gripper, name) else gripper.training
            own: tuple[float, float] | float = getattr(source, name)
            setattr(config, entry.name, list(own) if isinstance(own, tuple) else own)
