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
_NEEDED = ("t", "qg", "qm", "vir")
#: The drive's constants as they were published, where a copy of the data lacks them: N/V, 1/s, V·s/m.
_DRIVE = {"gtau": 35.15, "kp": 160.18, "kv": 243.45}


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
    except OSError as error:
        raise MeasurementError(f"{file}: can't be read: {error}") from error
    except Exception as error:  # scipy raises whatever its reader meets
        raise MeasurementError(f"{file}: is no MATLAB file that can be read (version 7 or older: -v7)") from error
    if missing := [name for name in _NEEDED if name not in content]:
        there = ", ".join(sorted(name for name in content if not name.startswith("__")))
        kind = OtherFileError if len(missing) == len(_NEEDED) else MeasurementError
        raise kind(f"{file}: lacks {', '.join(missing)}; it has {there}")
    there = [name for name in (*_NEEDED, *_DRIVE, "pulses_N") if name in content]
    try:
        one = {name: np.asarray(content[name], float).ravel() for name in there}
    except (TypeError, ValueError) as error:
        raise MeasurementError(f"{file}: {', '.join(there)} must be numbers") from error
    sizes = {name: len(values) for name, values in one.items() if name not in _DRIVE}
    if len(set(sizes.values())) > 1 or any(not one[name].size for name in one):
        lengths = ", ".join(f"{name} {size}" for name, size in sizes.items())
        raise MeasurementError(f"{file}: signals of different lengths: {lengths}")
    settings = {name: float(one[name][0]) if name in one else value for name, value in _DRIVE.items()}
    load, without = None, [name for name in _DRIVE if name not in one]
    notes = [f"{name}: not in it, taken as published, {settings[name]}" for name in without]
    force = settings["gtau"] * one["vir"]
    if "pulses_N" in content:  # positions move by what volts would do, not newtons, and vir holds them already
        load = settings["gtau"] * one["pulses_N"]
        force = force - load
        notes.append("pulses_N: taken as volts that were added at the drive, gtau newtons each")
    force = np.r_[force[:1], force[:-1]]  # what a row holds follows from its position, and acts until the next
    return Recording(
        file.stem, ("carriage",), one["t"] - one["t"][0], one["qg"][:, None], one["qm"][:, None],
        effort=force[:, None], effort_unit="N", load=load, settings=settings,
        notes=tuple(notes),
    )  # fmt: skip
