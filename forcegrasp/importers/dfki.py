"""Recordings of DFKI's torque limited simple pendulum: data_measured.csv and data_desired.csv in a folder."""

from __future__ import annotations

from pathlib import Path

from forcegrasp.errors import MeasurementError
from forcegrasp.importers.recording import Recording
from forcegrasp.importers.tables import read_columns

MECHANISM = "dfki_pendulum"
_NEEDED = ("time", "position", "torque")


def find(source: Path) -> list[Path]:
    """Folders of recordings at or below a folder."""
    return sorted(f.parent for f in source.glob("**/data_measured.csv"))


def read(folder: Path) -> Recording:
    """Reads one recording: the torque that the drive measured is the command, the position what followed from it.

    Raises:
      MeasurementError: if a column is missing, or a number can't be read.
    """
    file = folder / "data_measured.csv"
    table = read_columns(file)
    columns = table.numbers
    if missing := [name for name in _NEEDED if name not in columns]:
        raise MeasurementError(f"{file}: no column {', '.join(missing)}; it has {', '.join(columns)}")
    skipped = sorted(set(columns) - set(_NEEDED))
    notes = [*table.notes, *([f"skipped: {', '.join(skipped)}"] if skipped else [])]
    return Recording(
        folder.name, ("joint",), columns["time"], columns["torque"][:, None], columns["position"][:, None],
        command_unit="N·m", notes=tuple(notes),
    )  # fmt: skip
