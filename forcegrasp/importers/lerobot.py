"""Datasets of LeRobot (github.com/huggingface/lerobot), v2 and v3: Parquet files of actions and states."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from forcegrasp.errors import MeasurementError
from forcegrasp.files.bounded import read_bytes
from forcegrasp.importers.recording import OtherFileError, Recording
from forcegrasp.importers.tables import read_parquet

MECHANISM = "so101_jaw"
_MAX_BYTES = 50_000_000
_NEEDED = ("action", "observation.state", "timestamp", "episode_index")
# Joints of an arm stand in degrees in newer datasets; its gripper in per cent of its range.
_SPAN_RAD = 7.0


def find(source: Path) -> list[Path]:
    """Parquet files of frames at or below a dataset's folder, or the file itself."""
    if source.is_file():
        return [source]
    return sorted(file for file in source.glob("**/*.parquet") if "meta" not in file.relative_to(source).parts)


def read_all(file: Path) -> Iterator[Recording]:
    """The episodes of a file, one recording each.

    Raises:
      MeasurementError: if a column is missing; all are named.
    """
    table = read_parquet(file)
    if missing := [name for name in _NEEDED if name not in table.columns]:
        kind = OtherFileError if len(missing) == len(_NEEDED) else MeasurementError
        raise kind(f"{file}: no column {', '.join(missing)}; it has {', '.join(table.columns)}")
    names = _names(file)
    for (episode,), rows in table.group_by(["episode_index"], maintain_order=True):
        command, position = (np.array(rows[name].to_list(), float) for name in ("action", "observation.state"))
        if command.ndim != 2 or command.shape != position.shape:
            raise MeasurementError(f"{file}: episode {episode}: action and observation.state differ in width")
        joints = names if len(names) == command.shape[1] else tuple(f"joint_{i}" for i in range(command.shape[1]))
        scale, notes = _units(joints, position)
        time_s = rows["timestamp"].to_numpy().astype(float)
        yield Recording(
            f"episode_{int(str(episode)):06d}",
            joints,
            time_s - time_s[0],
            command * scale,
            position * scale,
            notes=notes,
        )


def _units(joints: tuple[str, ...], position: np.ndarray) -> tuple[np.ndarray, tuple[str, ...]]:
    """Radians of one unit of each joint, and what was guessed."""
    if np.abs(position).max() <= _SPAN_RAD:
        return np.ones(len(joints)), ("positions are taken as radians",)
    scale = np.full(len(joints), np.pi / 180)
    return scale, ("positions are taken as degrees",)


def _names(file: Path) -> tuple[str, ...]:
    """Names of the joints, of meta/info.json above the file; empty if there are none."""
    for folder in file.parents[:4]:
        info = folder / "meta" / "info.json"
        if info.is_file():
            try:
                found: Any = json.loads(read_bytes(info, _MAX_BYTES))["features"]["action"]["names"]
            except (OSError, ValueError, KeyError, TypeError):
                return ()
            found = next(iter(found.values())) if isinstance(found, dict) else found
            return tuple(str(name).removesuffix(".pos") for name in found) if isinstance(found, list) else ()
    return ()
