"""What an option is, and how options are checked."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Collection
from dataclasses import field
from typing import Any, cast

from forcegrasp.errors import ConfigError


def option(
    default: Any,
    doc: str,
    *,
    unit: str = "",
    source: str = "",
    low: float = -math.inf,
    high: float = math.inf,
    choices: Collection[str] = (),
    of_gripper: str = "",
) -> Any:
    """A dataclass field that also says what it means, and what it may be. ``low`` and ``high`` are inclusive.

    ``of_gripper`` names what of the gripper's description stands in where the option is left out.
    """
    meta = {"doc": doc, "unit": unit, "source": source, "low": low, "high": high, "choices": choices}
    meta["of_gripper"] = of_gripper
    if isinstance(default, list):
        return field(default_factory=lambda: list(cast("list[Any]", default)), metadata=meta)
    return field(default=default, metadata=meta)


def of_gripper(default: Any, entry: str, doc: str, **more: Any) -> Any:
    """An :func:`option` that is left to the gripper's description unless it is given.

    Args:
      default: ``[]`` for a range, NaN for a number: what stands for "left out".
      entry: of :class:`~forcegrasp.physics.gripper_parts.Training`, or of the gripper itself.
      doc: what it means.
      more: as for :func:`option`.
    """
    return option(default, doc, of_gripper=entry, **more)


def is_left_out(value: Any) -> bool:
    """Whether a value stands for one that the gripper's description has."""
    return value == [] or (isinstance(value, float) and math.isnan(value))


_ITEM_TYPES = {"list[float]": (int, float), "list[int]": (int,), "list[str]": (str,)}


def validate(config: Any, path: str = "") -> None:
    """Checks every option of a config dataclass against its bounds and choices.

    Raises:
      ConfigError: names the option, its value, and what it must be.
    """
    for entry in dataclasses.fields(config):
        name = f"{path}{entry.name}"
        value = getattr(config, entry.name)
        if dataclasses.is_dataclass(value):
            validate(value, f"{name}.")
            continue
        meta, listed = entry.metadata, isinstance(value, list)
        if meta["of_gripper"] and is_left_out(value):
            continue
        is_range = str(entry.type) == "list[float]"
        if is_range and (len(value) != 2 or value[0] > value[1]):
            raise ConfigError(f"{name}={value}: must be [low, high] with low ≤ high ({meta['doc']})")
        if listed and not value and entry.default_factory is not dataclasses.MISSING and entry.default_factory():
            raise ConfigError(f"{name}=[]: must not be empty ({meta['doc']})")
        for item in value if listed else [value]:
            if meta["choices"] and item not in list(meta["choices"]):
                raise ConfigError(f"{name}={item}: must be one of {', '.join(meta['choices'])}")
            number = isinstance(item, (int, float)) and not isinstance(item, bool)
            if number and not meta["low"] <= item <= meta["high"]:  # also refuses NaN
                raise ConfigError(f"{name}={item}: must lie in [{meta['low']:g}, {meta['high']:g}] ({meta['doc']})")
            if listed and (not isinstance(item, _ITEM_TYPES[str(entry.type)]) or isinstance(item, bool)):
                raise ConfigError(f"{name}={value}: each item must be a {str(entry.type)[5:-1]} ({meta['doc']})")
        if listed and len(set(map(str, value))) < len(value) and meta["choices"]:
            raise ConfigError(f"{name}={value}: names a part twice")
    if hasattr(config, "check"):
        config.check(path)
