"""Logs of BAM (github.com/Rhoban/bam): one JSON file per recording of a servo with a pendulum."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from forcegrasp.errors import MeasurementError
from forcegrasp.files.bounded import read_bytes
from forcegrasp.importers.recording import OtherFileError, Recording, files_below

MECHANISM = "xl330_pendulum"
_MAX_BYTES = 200_000_000
_NEEDED = ("timestamp", "goal_position", "position")
_SETTINGS = ("kp", "mass", "length", "arm_mass", "vin")


def find(source: Path) -> list[Path]:
    """Files of recordings at or below a folder, or the file itself."""
    return files_below(source, "*.json")


def read(file: Path) -> Recording:
    """Reads one recording. The load that it holds has no unit that is known, and is kept as it is.

    Raises:
      MeasurementError: if it is not such a log; all missing columns are named.
    """
    try:
        log = json.loads(read_bytes(file, _MAX_BYTES))
        entries: list[dict[str, Any]] = log["entries"]
        there = set(entries[0])
    except (OSError, ValueError, KeyError, IndexError, TypeError, RecursionError) as error:
        raise OtherFileError(f"{file}: is no log of BAM: a JSON object with a list `entries` is needed") from error
    if missing := [name for name in _NEEDED if name not in there]:
        raise MeasurementError(f"{file}: entries lack {', '.join(missing)}; they have {', '.join(sorted(there))}")
    columns = {name: _column(file, entries, name) for name in (*_NEEDED, "load", "torque_enable") if name in there}
    settings = {name: float(log[name]) for name in _SETTINGS if isinstance(log.get(name), int | float)}
    skipped = sorted(there - set(columns))
    notes = (f"skipped: {', '.join(skipped)}",) if skipped else ()
    load = columns.get("load")
    name = f"{file.stem}_{log.get('trajectory', '')}".rstrip("_")
    return Recording(
        name, (str(log.get("motor", "joint")),),
        columns["timestamp"] - columns["timestamp"][0], columns["goal_position"][:, None], columns["position"][:, None],
        effort=None if load is None else load[:, None], effort_unit="1" if load is not None else "",
        enabled=columns["torque_enable"] > 0.5 if "torque_enable" in columns else None,
        settings=settings, notes=notes,
    )  # fmt: skip


def _column(file: Path, entries: list[dict[str, Any]], name: str) -> np.ndarray:
    try:
        return np.array([float(entry[name]) for entry in entries])
    except (KeyError, TypeError, ValueError) as error:
        row = next(i for i, entry in enumerate(entries) if not isinstance(entry.get(name), int | float))
        raise MeasurementError(f"{file}: entry {row}: {name} must be a number") from error
