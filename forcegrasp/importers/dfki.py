"""Recordings of DFKI's torque limited simple pendulum: CSV files of what was measured."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from forcegrasp.errors import MeasurementError
from forcegrasp.importers.recording import OtherFileError, Recording, files_below
from forcegrasp.importers.tables import read_columns

MECHANISM = "dfki_pendulum"
#: What a quantity may be called: by the control loop as it is now, in the published results, and before filtering.
_NAMES = {
    "time": ("meas_time", "time"), "position": ("meas_pos", "position", "pos"),
    "torque": ("meas_tau", "torque", "tau"),
}  # fmt: skip


def find(source: Path) -> list[Path]:
    """Files of recordings at or below a folder, or the file itself."""
    return files_below(source, "*measured*.csv", "experiment_*.csv")


def read(file: Path) -> Recording:
    """Reads one recording: the torque that the drive measured is the command, the position what followed from it.

    Raises:
      MeasurementError: if a column is missing, or a number can't be read.
    """
    if "desired" in file.name:
        raise OtherFileError(f"{file}: holds what was desired; give the file of what was measured")
    table = read_columns(file)
    found = {key: next((name for name in names if name in table.numbers), "") for key, names in _NAMES.items()}
    if missing := [key for key in _NAMES if not found[key]]:
        kind = OtherFileError if len(missing) == len(_NAMES) else MeasurementError
        raise kind(f"{file}: no numbers in a column {', '.join(missing)}; it has {table.holds()}")
    columns = {key: table.numbers[name] for key, name in found.items()}
    skipped = sorted((set(table.numbers) | set(table.texts)) - {*found.values(), ""})
    notes = [*table.notes, *([f"skipped: {', '.join(skipped)}"] if skipped else [])]
    # a loop that was stopped leaves zeros in what it had not reached
    rows = int(np.flatnonzero(columns["time"])[-1]) + 1 if columns["time"].any() else table.rows
    if rows < table.rows:
        notes.append(f"{file.name}: left out {table.rows - rows} rows of zeros after the end")
    name = f"{file.parent.resolve().name}_{file.stem.removeprefix('data_measured').strip('_')}".rstrip("_")
    return Recording(
        name, ("joint",), columns["time"][:rows], columns["torque"][:rows, None], columns["position"][:rows, None],
        command_unit="N·m", notes=tuple(notes),
    )  # fmt: skip
