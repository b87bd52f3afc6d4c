"""Recordings of SAGE (github.com/isaac-sim2real/sage): control.csv, state_motor.csv and joint_list.txt in a folder."""

from __future__ import annotations

import csv
import io
import json
import re
from pathlib import Path

import numpy as np

from forcegrasp.errors import MeasurementError
from forcegrasp.files.bounded import read_bytes
from forcegrasp.importers.encoder import COUNTS, radians_per_unit
from forcegrasp.importers.recording import Recording, files_below, unlike_a_jaw

#: What the importer tells of itself.
MECHANISM, unlike = "so101_jaw", unlike_a_jaw
_MAX_BYTES = 200_000_000
#: How NumPy shows its own numbers in a list.
_WRAPPED = re.compile(r"np\.\w+\(([^()]*)\)")
#: More than two turns are taken as degrees.
_SPAN_RAD = 4 * np.pi
#: The range of the jaw of the public recordings, where a log has too few steps to count them.
_RANGE_RAD = 1521 / COUNTS * 2 * np.pi


def find(source: Path) -> list[Path]:
    """Folders of recordings at or below a folder, or the one that a file is in."""
    if source.is_file() or (source / "control.csv").is_file():
        return [source.parent if source.is_file() else source]
    return [file.parent for file in files_below(source, "control.csv")]


def read(folder: Path) -> Recording:
    """Reads one recording.

    Commands and states of one time stamp belong to one turn of the log's loop; the state was read after the command was
    sent. Where they have stamps of their own, a state has the newest command before it.

    Raises:
      MeasurementError: if a file lacks a column, or rows do not fit together.
    """
    commands = _table(folder / "control.csv", ("timestamp", "positions"))
    states = _table(folder / "state_motor.csv", ("timestamp", "positions", "torques"), optional=("torques",))
    wide = max(commands["positions"].shape[1], states["positions"].shape[1])
    listed, notes = _listed(folder / "joint_list.txt", wide)
    joints = listed[-min(commands["positions"].shape[1], states["positions"].shape[1]) :]
    if len(joints) < len(listed):
        notes.append(f"a row has {len(joints)} numbers for {len(listed)} joints: taken as {joints[0]} to {joints[-1]}")
    unit_s = _unit_s(folder, states["timestamp"][:, 0], notes)
    sent, stamps = commands["timestamp"][:, 0], states["timestamp"][:, 0]
    if (np.diff(sent) < 0).any():
        raise MeasurementError(f"{folder / 'control.csv'}: time runs back; these may be several recordings: part them")
    both = (stamps >= sent[0]) & (stamps <= sent[-1])
    newest = np.searchsorted(sent, stamps[both], side="right") - 1
    if not np.array_equal(sent[newest], stamps[both]):
        notes.append("commands have time stamps of their own: a state has the newest command before it")
    time_s = stamps[both] * unit_s
    command = commands["positions"][newest][:, -len(joints) :]
    position = states["positions"][both][:, -len(joints) :]
    if np.nanmax(np.abs(position), initial=0) > _SPAN_RAD:
        command, position = np.deg2rad(command), np.deg2rad(position)
        notes.append("positions are taken as degrees")
    for index, joint in enumerate(joints):
        if _is_share(joint, position[:, index]):
            scale = radians_per_unit(position[:, index])
            why = f"for its counts are 1/{COUNTS} of a turn" if scale else "as of the public recordings"
            scale = scale or _RANGE_RAD
            command[:, index] *= scale
            position[:, index] *= scale
            notes.append(f"{joint}: 0..1 of its range is taken as {scale:.4g} rad, {why}")
    effort, signed = states.get("torques"), False
    if effort is not None:
        effort = effort[both][:, -len(joints) :]
        signed = bool(np.nanmin(effort, initial=0) < 0)
        notes.append("torques: " + ("taken as N·m" if signed else "the size of a current without its sign"))
    return Recording(
        folder.resolve().name, joints, time_s, command, position,
        effort=effort, effort_unit="N·m" if effort is not None else "", effort_signed=signed, notes=tuple(notes),
    )  # fmt: skip


def _listed(path: Path, wide: int) -> tuple[tuple[str, ...], list[str]]:
    """Names of the joints, the last part of each where they are paths, and what was guessed."""
    if not path.is_file():
        names = tuple(f"joint_{i}" for i in range(wide))
        return names, [f"no {path.name}: the joints are called {names[0]} to {names[-1]}"]
    names = tuple(line.strip().split("/")[-1] for line in _text(path).splitlines() if line.strip())
    if len(names) < wide:
        raise MeasurementError(f"{path}: {len(names)} joints, and rows of {wide} numbers")
    return names, []


def _unit_s(folder: Path, stamps: np.ndarray, notes: list[str]) -> float:
    """Seconds of one unit of the time stamps. The collectors of Unitree and Realman write 10 µs, and a simulation s."""
    if len(stamps) > 1 and np.median(np.diff(stamps)) < 1:
        notes.append("time stamps are taken as seconds")
        return 1.0
    events = folder / "event.csv"
    if events.is_file() and "MOTION_END" in _text(events):
        notes.append("time stamps are taken as 10 µs each, as those collectors write them that say MOTION_END")
        return 1e-5
    return 1e-6


def _is_share(joint: str, position: np.ndarray) -> bool:
    return joint.lower() in ("jaw", "gripper") and bool(position.min() >= -0.05 and position.max() <= 1.05)


def _text(path: Path) -> str:
    try:
        return read_bytes(path, _MAX_BYTES).decode("utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise MeasurementError(f"{path}: can't be read: {error}") from error


def _table(path: Path, columns: tuple[str, ...], optional: tuple[str, ...] = ()) -> dict[str, np.ndarray]:
    """Columns as ``(T, 1)`` or, where a cell is a list of one number per joint, ``(T, J)``."""
    rows = csv.DictReader(io.StringIO(_text(path)))
    there = rows.fieldnames or []
    if missing := [name for name in columns if name not in there and name not in optional]:
        raise MeasurementError(f"{path}: no column {', '.join(missing)}; it has {' '.join(', '.join(there).split())}")
    wanted = [name for name in columns if name in there]
    found: dict[str, list[list[float]]] = {name: [] for name in wanted}
    for number, row in enumerate(rows, start=2):
        if row.get("type") == "EVENT":
            continue
        for name in wanted:
            try:
                value = json.loads(_WRAPPED.sub(r"\1", row[name] or "").replace("nan", "NaN"))
                numbers = [float(v) for v in value] if isinstance(value, list) else [float(value)]
            except (ValueError, TypeError) as error:
                raise MeasurementError(f"{path}, row {number}: {name}={row[name]!r}: must be numbers") from error
            wide = len(found[name][0]) if found[name] else len(numbers)
            if len(numbers) != wide:
                raise MeasurementError(f"{path}, row {number}: {name} has {len(numbers)} numbers, and above {wide}")
            found[name].append(numbers)
    if len(found["timestamp"]) < 2:
        raise MeasurementError(f"{path}: needs at least two rows")
    return {name: np.array(values, float) for name, values in found.items()}
