"""Recordings of SAGE (github.com/isaac-sim2real/sage): control.csv, state_motor.csv and joint_list.txt in a folder."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

import numpy as np

from forcegrasp.errors import MeasurementError
from forcegrasp.files.bounded import read_bytes
from forcegrasp.importers.recording import Recording

#: What the importer tells of itself.
MECHANISM = "so101_jaw"
_MAX_BYTES = 200_000_000
#: A turn of the encoder of a Feetech STS3215, and its counts.
_TURN_RAD, _COUNTS = 2 * np.pi, 4096


def find(source: Path) -> list[Path]:
    """Folders of recordings at or below a folder."""
    return [source] if (source / "control.csv").is_file() else sorted(f.parent for f in source.glob("**/control.csv"))


def read(folder: Path) -> Recording:
    """Reads one recording.

    Commands and states of one row belong to one turn of the log's loop; the state was read after the command was sent.

    Raises:
      MeasurementError: if a file lacks a column, or rows do not fit together.
    """
    joints = tuple(_text(folder / "joint_list.txt").split())
    commands = _table(folder / "control.csv", ("timestamp", "positions"), len(joints))
    states = _table(
        folder / "state_motor.csv", ("timestamp", "positions", "torques"), len(joints), optional=("torques",)
    )
    count = min(len(commands["timestamp"]), len(states["timestamp"]))
    time_s = commands["timestamp"][:count, 0] * 1e-6
    command, position = commands["positions"][:count], states["positions"][:count]
    notes = []
    for index, joint in enumerate(joints):
        if _is_share(joint, position[:, index]):
            scale = _radians_per_share(position[:, index])
            command, position = command.copy(), position.copy()
            command[:, index] *= scale
            position[:, index] *= scale
            notes.append(
                f"{joint}: 0..1 of its range is taken as {scale:.4g} rad, for its counts are 1/{_COUNTS} of a turn"
            )
    effort = states.get("torques")
    if effort is not None:
        effort = effort[:count]
        notes.append("torques: the size of a current without its sign")
    return Recording(
        folder.name, joints, time_s - time_s[0], command, position,
        effort=effort, effort_unit="N·m" if effort is not None else "", effort_signed=False, notes=tuple(notes),
    )  # fmt: skip


def _is_share(joint: str, position: np.ndarray) -> bool:
    return joint.lower() in ("jaw", "gripper") and bool(position.min() >= -0.05 and position.max() <= 1.05)


def _radians_per_share(position: np.ndarray) -> float:
    """Radians that the whole range has, from the smallest step between readings, which is a count of the encoder."""
    steps = np.diff(np.unique(np.round(position, 9)))
    least = steps[steps > 1e-6]
    count = float(np.median(least[least < 1.5 * least.min()])) if len(least) else 1 / 1521
    return _TURN_RAD / _COUNTS / count


def _text(path: Path) -> str:
    try:
        return read_bytes(path, _MAX_BYTES).decode("utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise MeasurementError(f"{path}: can't be read: {error}") from error


def _table(path: Path, columns: tuple[str, ...], joints: int, optional: tuple[str, ...] = ()) -> dict[str, np.ndarray]:
    """Columns as ``(T, 1)`` or, where a cell is a list of one number per joint, ``(T, J)``."""
    rows = csv.DictReader(io.StringIO(_text(path)))
    there = rows.fieldnames or []
    if missing := [name for name in columns if name not in there and name not in optional]:
        raise MeasurementError(f"{path}: no column {', '.join(missing)}; it has {', '.join(there)}")
    wanted = [name for name in columns if name in there]
    found: dict[str, list[list[float]]] = {name: [] for name in wanted}
    for number, row in enumerate(rows, start=2):
        for name in wanted:
            try:
                value = json.loads(row[name] or "")
                numbers = [float(v) for v in value] if isinstance(value, list) else [float(value)]
            except (ValueError, TypeError) as error:
                raise MeasurementError(f"{path}, row {number}: {name}={row[name]!r}: must be numbers") from error
            if name != "timestamp" and len(numbers) != joints:
                raise MeasurementError(f"{path}, row {number}: {name} has {len(numbers)} numbers for {joints} joints")
            found[name].append(numbers)
    return {name: np.array(values, float) for name, values in found.items()}
