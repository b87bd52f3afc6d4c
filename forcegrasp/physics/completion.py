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
            fixed = name == "servo_gain_range" and config.servo_gain == "nominal"
            own = [gripper.nominal_gain] * 2 if fixed else _own(gripper, name)
            setattr(config, entry.name, list(own) if isinstance(own, tuple) else own)


def _own(gripper: Gripper, name: str) -> tuple[float, ...] | float:
    return getattr(gripper if hasattr(gripper, name) else gripper.training, name)
