"""The benchmark EMPS (Janot, Gautier, Brunot 2019): a carriage on a ball screw, as MATLAB files."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np

from forcegrasp.errors import MeasurementError
from forcegrasp.files.bounded import read_bytes
from forcegrasp.importers.recording import OtherFileError, Recording, files_below

MECHANISM = "emps"
_MAX_BYTES = 200_000_000
_NEEDED = ("t", "qg", "qm", "vir", "gtau", "kp", "kv")


def find(source: Path) -> list[Path]:
    """Files of recordings at or below a folder, or the file itself."""
    return files_below(source, "*.mat")


def read(file: Path) -> Recording:
    """Reads one recording: the reference qg is the command, the motor's force (gtau · vir) the effort.

    Raises:
      MeasurementError: if it is not such a file; all missing variables are named.
    """
    from scipy.io import loadmat

    try:
        content = loadmat(io.BytesIO(read_bytes(file, _MAX_BYTES)))
    except Exception as error:  # scipy raises whatever its reader meets
        raise MeasurementError(f"{file}: is no MATLAB file that can be read (version 7 or older)") from error
    if missing := [name for name in _NEEDED if name not in content]:
        there = ", ".join(sorted(name for name in content if not name.startswith("__")))
        kind = OtherFileError if len(missing) == len(_NEEDED) else MeasurementError
        raise kind(f"{file}: lacks {', '.join(missing)}; it has {there}")
    one = {name: np.asarray(content[name], float).ravel() for name in _NEEDED}
    settings = {name: float(one[name][0]) for name in ("gtau", "kp", "kv")}
    load, notes = None, ()
    force = settings["gtau"] * one["vir"]
    if "pulses_N" in content:  # positions move by what volts would do, not newtons, and vir holds them already
        load = settings["gtau"] * np.asarray(content["pulses_N"], float).ravel()
        force = force - load
        notes = ("pulses_N: taken as volts that were added at the drive, gtau newtons each",)
    force = np.r_[force[:1], force[:-1]]  # what a row holds follows from its position, and acts until the next
    return Recording(
        file.stem, ("carriage",), one["t"] - one["t"][0], one["qg"][:, None], one["qm"][:, None],
        effort=force[:, None], effort_unit="N", load=load, settings=settings,
        notes=notes,
    )  # fmt: skip
