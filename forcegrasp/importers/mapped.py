"""Any CSV or Parquet file of a servo's log, as a map of a few lines says.

```yaml
time: {column: timestamp, unit: ms}            # s, ms, us or ns; default s
joints: [jaw]                                  # {joint} in a column's name stands for each of them
command: {column: "goal_{joint}", unit: deg}   # rad, deg, turns, counts, m, mm or um; N, N·m or V for others
position: {column: "pos_{joint}", unit: counts, per_turn: 4096, sign: -1, offset: 0.1}
effort: {column: "current_{joint}", unit: N·m, scale: 0.0228, signed: false}
enabled: torque_enable                         # whether the motor was switched on
load: external_n                               # a force or torque from outside
recording: run                                 # one recording for each value of this column; default: one per file
```

A value in SI units is ``sign · scale · unit · value + offset``.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from forcegrasp.errors import MeasurementError, closest
from forcegrasp.importers.recording import Recording
from forcegrasp.importers.tables import read_columns, read_parquet
from forcegrasp.measure.yaml_file import load_yaml

TIMES = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
POSITIONS = {
    "rad": 1.0, "deg": math.pi / 180, "turns": 2 * math.pi, "counts": math.nan, "m": 1.0, "mm": 1e-3, "um": 1e-6,
}  # fmt: skip
FORCES = ("N", "N·m", "V", "A", "1")
_KEYS = ("time", "joints", "command", "position", "effort", "enabled", "load", "recording")
_NEEDED = ("time", "joints", "command", "position")
_COLUMN_KEYS = ("column", "unit", "per_turn", "scale", "sign", "offset", "signed")


@dataclasses.dataclass(frozen=True)
class _Source:
    """Where a quantity comes from, and what one of its unit is in SI units."""

    column: str
    unit: str
    factor: float
    offset: float
    signed: bool

    def of(self, columns: Mapping[str, np.ndarray], joint: str) -> np.ndarray:
        return columns[self.name(joint)] * self.factor + self.offset

    def name(self, joint: str) -> str:
        return self.column.replace("{joint}", joint)


class Map:
    """A map that was read.

    Raises:
      MeasurementError: key and what it must be.
    """

    def __init__(self, path: Path) -> None:
        content = load_yaml(path)
        if wrong := [key for key in content if key not in _KEYS]:
            raise MeasurementError(f"{path}: {wrong[0]}: no such key{closest(wrong[0], _KEYS)}")
        if missing := [key for key in _NEEDED if key not in content]:
            raise MeasurementError(f"{path}: lacks {', '.join(missing)}; as in `time: {{column: t, unit: s}}`")
        joints = content["joints"]
        self.joints = tuple(joints if isinstance(joints, list) else [joints])
        self.time = _source(path, "time", content["time"], TIMES)
        self.command = _source(path, "command", content["command"], POSITIONS)
        self.position = _source(path, "position", content["position"], POSITIONS)
        self.effort = _source(path, "effort", content["effort"], {}) if "effort" in content else None
        self.enabled, self.load, self.recording = (content.get(key, "") for key in ("enabled", "load", "recording"))

    def columns(self) -> list[str]:
        """Names of all columns that it asks for."""
        sources = [self.command, self.position, *([self.effort] if self.effort else [])]
        named = [source.name(joint) for source in sources for joint in self.joints]
        return [self.time.column, *named, *(name for name in (self.enabled, self.load, self.recording) if name)]


def _source(path: Path, key: str, given: Any, units: Mapping[str, float]) -> _Source:
    entry: dict[str, Any] = {"column": given} if isinstance(given, str) else given
    if not isinstance(entry, dict) or "column" not in entry:
        raise MeasurementError(f"{path}: {key}: must name a column, as in `{key}: {{column: name}}`")
    if wrong := [name for name in entry if name not in _COLUMN_KEYS]:
        raise MeasurementError(f"{path}: {key}: {wrong[0]}: no such key{closest(wrong[0], _COLUMN_KEYS)}")
    unit = str(entry.get("unit", next(iter(units), "1")))
    if unit not in units and unit not in FORCES:
        raise MeasurementError(f"{path}: {key}: unit: {unit} is none of {', '.join([*units, *FORCES])}")
    numbers = {name: _number(path, f"{key}: {name}", entry.get(name, 1 if name != "offset" else 0)) for name in
               ("scale", "sign", "offset")}  # fmt: skip
    if unit == "counts":
        if "per_turn" not in entry:
            raise MeasurementError(f"{path}: {key}: counts need `per_turn: 4096` or the like")
        one = 2 * math.pi / _number(path, f"{key}: per_turn", entry["per_turn"])
    else:
        one = units.get(unit, 1.0)
    signed = str(entry.get("signed", "true")).lower() != "false"
    return _Source(str(entry["column"]), unit, one * numbers["scale"] * numbers["sign"], numbers["offset"], signed)


def _number(path: Path, key: str, value: Any) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = math.nan
    if not math.isfinite(number) or (number == 0 and not key.endswith("offset")):
        raise MeasurementError(f"{path}: {key}: {value!r}: must be a number, and not 0")
    return number


def find(source: Path) -> list[Path]:
    """CSV and Parquet files at or below a folder, or the file itself."""
    if source.is_file():
        return [source]
    return sorted(f for f in source.glob("**/*") if f.suffix in (".csv", ".parquet"))


def read_all(file: Path, columns_of: Map) -> Iterator[Recording]:
    """The recordings of a file.

    Raises:
      MeasurementError: if columns are missing; all are named.
    """
    table = _table(file)
    wanted = columns_of.columns()
    if missing := [name for name in wanted if name not in table]:
        near = closest(missing[0], table)
        raise MeasurementError(
            f"{file}: no column of numbers called {', '.join(missing)}{near}; it has {', '.join(table)}"
        )
    runs = table[columns_of.recording] if columns_of.recording else np.zeros(len(next(iter(table.values()))))
    skipped = sorted(set(table) - set(wanted))
    notes = (f"skipped: {', '.join(skipped)}",) if skipped else ()
    for run in dict.fromkeys(runs.tolist()):
        rows = {name: values[runs == run] for name, values in table.items()}
        name = f"{file.stem}_{run:g}" if columns_of.recording else file.stem
        yield _recording(name, rows, columns_of, notes)


def _recording(name: str, rows: Mapping[str, np.ndarray], m: Map, notes: tuple[str, ...]) -> Recording:
    time_s = m.time.of(rows, "")
    command, position = (np.stack([s.of(rows, j) for j in m.joints], axis=1) for s in (m.command, m.position))
    effort = None if m.effort is None else np.stack([m.effort.of(rows, j) for j in m.joints], axis=1)
    return Recording(
        name, m.joints, time_s - time_s[0], command, position,
        command_unit=m.command.unit if m.command.unit in FORCES else "",
        effort=effort, effort_unit=m.effort.unit if m.effort else "", effort_signed=not m.effort or m.effort.signed,
        enabled=rows[m.enabled] > 0.5 if m.enabled else None, load=rows[m.load] if m.load else None, notes=notes,
    )  # fmt: skip


def _table(file: Path) -> dict[str, np.ndarray]:
    if file.suffix != ".parquet":
        return read_columns(file)
    table = read_parquet(file)
    kept = [name for name, kind in table.schema.items() if kind.is_numeric() or kind == pl.Boolean]
    return {name: table[name].cast(pl.Float64).to_numpy() for name in kept}
