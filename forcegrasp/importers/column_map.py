"""The map of a log's columns as its file is written: every key, what it says, its unit and its default."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, model_validator

from forcegrasp.errors import MeasurementError
from forcegrasp.files.validate import must, validate, wrong
from forcegrasp.measure.folder import show
from forcegrasp.measure.yaml_file import Number, Positive, Text, TextRecord, load_yaml

_TIMES = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
_POSITIONS = {
    "rad": 1.0, "deg": math.pi / 180, "turns": 2 * math.pi, "counts": math.nan, "m": 1.0, "mm": 1e-3, "um": 1e-6,
}  # fmt: skip
#: Units of commands that are no positions, and of efforts; as they are written, and as they are told.
FORCES = {"N": "N", "N·m": "N·m", "Nm": "N·m", "V": "V", "A": "A", "1": "1"}


class Place(TextRecord):
    """Where a quantity is in a log: a column of a table, or a field of a bag's topic."""

    column: Text = Field(examples=["{column: goal}"])
    topic: Text | None = Field(default=None, description="of a ROS bag; the column is then a field of its messages")

    def name(self, joint: str = "") -> str:
        """The column of a joint."""
        return self.column.replace("{joint}", joint)

    def key(self, joint: str = "") -> str:
        """What tells the column of a joint from all others."""
        return f"{self.topic} {self.name(joint)}" if self.topic else self.name(joint)


class _Time(Place):
    unit: Literal["s", "ms", "us", "ns"] = "s"

    @property
    def factor(self) -> float:
        """Seconds of one unit."""
        return _TIMES[self.unit]


class Quantity(Place):
    """Numbers of a joint, and what one of their unit is."""

    """Numbers of a joint, and what one of their unit is."""

    per_turn: Positive | None = Field(default=None, description="counts of a turn")
    scale: Annotated[Number, must(bool, "must not be 0")] = 1.0
    sign: Annotated[Number, must(lambda sign: abs(sign) == 1, "must be 1 or -1")] = 1.0
    offset: Number = 0.0

    def si(self, values: Any, unit: str) -> Any:
        """Values in SI units: ``sign · scale · unit · value + offset``."""
        one = 2 * math.pi / self.per_turn if self.per_turn and unit == "counts" else _POSITIONS.get(unit, 1.0)
        return self.sign * self.scale * one * values + self.offset


class _Position(Quantity):
    unit: Literal["rad", "deg", "turns", "counts", "m", "mm", "um"] = "rad"

    @model_validator(mode="after")
    def _counts_of_what(self) -> _Position:
        if self.unit == "counts" and self.per_turn is None:
            raise wrong("missing: counts need `per_turn: 4096` or the like", "per_turn")
        return self


class _Command(Quantity):
    unit: Literal["rad", "deg", "turns", "counts", "m", "mm", "um", "N", "N·m", "Nm", "V"] = "rad"

    @model_validator(mode="after")
    def _counts_of_what(self) -> _Command:
        if self.unit == "counts" and self.per_turn is None:
            raise wrong("missing: counts need `per_turn: 4096` or the like", "per_turn")
        return self


class _Effort(Quantity):
    unit: Literal["N", "N·m", "Nm", "A", "1"] = "1"
    signed: Literal["true", "false"] = "true"


def _named(given: Any) -> Any:
    return {"column": given} if isinstance(given, str) else given


def _listed(given: Any) -> Any:
    return [given] if isinstance(given, str) else given


_Column = BeforeValidator(_named)


class Map(TextRecord):
    """Which column of a log is what."""

    time: Annotated[_Time | None, _Column] = Field(default=None, examples=["{column: t, unit: s}"])
    joints: Annotated[list[Text], BeforeValidator(_listed)] = Field(examples=["[jaw]"], min_length=1)
    command: Annotated[_Command, _Column] = Field(examples=["{column: goal, unit: rad}"])
    position: Annotated[_Position, _Column] = Field(examples=["{column: position, unit: rad}"])
    effort: Annotated[_Effort | None, _Column] = None
    enabled: Annotated[Place | None, _Column] = None
    load: Annotated[Place | None, _Column] = None
    recording: Annotated[Place | None, _Column] = None

    @model_validator(mode="after")
    def _fits_together(self) -> Map:
        for key in ("command", "position", "effort"):
            source: Place | None = getattr(self, key)
            if source and len(self.joints) > 1 and "{joint}" not in source.column:
                raise wrong(f"{source.column}: {len(self.joints)} joints need `{{joint}}` in it", key, "column")
        sources = {key: value for key in type(self).model_fields if isinstance(value := getattr(self, key), Place)}
        topics = [key for key, place in sources.items() if place.topic]
        if topics and len(topics) < len(sources):
            other = next(key for key in sources if key not in topics)
            raise wrong(f"missing; {topics[0]} has one, and a log is a bag or a table", other, "topic")
        if not topics and self.time is None:
            raise wrong("missing, such as `{column: t, unit: s}`", "time")
        return self

    @property
    def is_of_bag(self) -> bool:
        """Whether it maps topics of a ROS bag, and not columns of a table."""
        return self.position.topic is not None

    def places(self) -> dict[str, tuple[Place, str]]:
        """Every column that it asks for: key → its place, and the joint that it is of."""
        per_joint = [source for source in (self.command, self.position, self.effort) if source]
        found: dict[str, tuple[Place, str]] = {self.time.key(): (self.time, "")} if self.time else {}
        found |= {source.key(joint): (source, joint) for source in per_joint for joint in self.joints}
        single = (self.enabled, self.load, self.recording)
        return found | {place.key(): (place, "") for place in single if place}


def read_map(path: Path) -> Map:
    """Reads a map.

    Raises:
      MeasurementError: all keys that are wrong, and what they must be.
    """
    return validate(Map, load_yaml(path), show(path), MeasurementError)
