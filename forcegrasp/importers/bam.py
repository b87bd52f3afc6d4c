"""Logs of BAM (github.com/Rhoban/bam): one JSON file per recording of a servo with a pendulum."""

from __future__ import annotations

import glob
import json
from pathlib import Path
from typing import Any

import numpy as np

from forcegrasp.errors import MeasurementError
from forcegrasp.files.bounded import read_bytes
from forcegrasp.importers.recording import OtherFileError, Recording, files_below

MECHANISM, ANY_MECHANISM = "xl330_pendulum", "bam_pendulum"
_MAX_BYTES = 200_000_000
_NEEDED = ("timestamp", "goal_position", "position")
_SETTINGS = ("kp", "mass", "length", "arm_mass", "vin")


def find(source: Path) -> list[Path]:
    """Files of recordings at or below a folder, or the file itself; of a log and its resampled copy, the log alone."""
    found = files_below(source, "*.json")
    raw = {file.name for file in found if not _is_copy(file)}
    return [file for file in found if not (_is_copy(file) and file.name in raw)]


def _is_copy(file: Path) -> bool:
    return "processed" in file.parent.name


def read(file: Path) -> Recording:
    """Reads one recording. The load that it holds has no unit that is known, and is kept as it is.

    Logs that were resampled need no time stamps: they say ``dt``.

    Raises:
      MeasurementError: if it is not such a log; all missing columns are named.
    """
    try:
        log = json.loads(read_bytes(file, _MAX_BYTES))
        entries: list[dict[str, Any]] = log["entries"]
        there = set(entries[0]).union(*(entry.keys() for entry in entries))
    except OSError as error:
        raise MeasurementError(f"{file}: can't be read: {error}") from error
    except (ValueError, KeyError, IndexError, TypeError, AttributeError, RecursionError) as error:
        raise OtherFileError(f"{file}: is no log of BAM: a JSON object with a list `entries` is needed") from error
    dt = log.get("dt")
    if "timestamp" not in there and isinstance(dt, int | float):
        entries = [{**entry, "timestamp": row * dt} for row, entry in enumerate(entries)]
        there.add("timestamp")
    if missing := [name for name in _NEEDED if name not in there]:
        raise MeasurementError(f"{file}: entries lack {', '.join(missing)}; they have {', '.join(sorted(there))}")
    columns = {name: _column(file, entries, name) for name in (*_NEEDED, "load", "torque_enable") if name in there}
    log = {name.replace("-", "_"): value for name, value in log.items()}  # one of its recorders says arm-mass
    settings = {name: float(log[name]) for name in _SETTINGS if isinstance(log.get(name), int | float)}
    skipped = sorted(there - set(columns))
    notes = (f"skipped: {', '.join(skipped)}",) if skipped else ()
    if not _is_copy(file) and any(file.resolve().parents[1].glob(f"*processed*/{glob.escape(file.name)}")):
        notes = (*notes, "logs are taken as they were recorded, and their copies in processed left out")
    load = columns.get("load")
    name = f"{file.stem}_{log.get('trajectory', '')}".rstrip("_")
    return Recording(
        name, (str(log.get("motor", "joint")),),
        columns["timestamp"] - columns["timestamp"][0], columns["goal_position"][:, None], columns["position"][:, None],
        effort=None if load is None else load[:, None], effort_unit="1" if load is not None else "",
        enabled=columns.get("torque_enable"), settings=settings, notes=notes,
    )  # fmt: skip


def _column(file: Path, entries: list[dict[str, Any]], name: str) -> np.ndarray:
    try:
        return np.array([np.nan if entry.get(name) is None else float(entry[name]) for entry in entries])
    except (TypeError, ValueError) as error:
        row = next(i for i, entry in enumerate(entries) if not isinstance(entry.get(name, 0), int | float | None))
        raise MeasurementError(f"{file}: entry {row}: {name} must be a number") from error


def mechanism_of(one: Recording) -> str:
    """The mechanism that comes with the package for a log's servo; mass and length of the pendulum are the log's."""
    return MECHANISM if one.joints[0].startswith("xl330") else ANY_MECHANISM
