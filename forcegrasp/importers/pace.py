"""Recordings of PACE (github.com/leggedrobotics/pace-sim2real): tensors time, dof_pos and des_dof_pos in a .pt file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from forcegrasp.errors import MeasurementError
from forcegrasp.importers.recording import OtherFileError, Recording, files_below
from forcegrasp.importers.torch_file import read_tensors

MECHANISM = ""  #: none that comes with the package
_NEEDED = ("time", "dof_pos", "des_dof_pos")


def find(source: Path) -> list[Path]:
    """Files of recordings at or below a folder, or the file itself."""
    return files_below(source, "*.pt")


def read(file: Path) -> Recording:
    """Reads one recording; of the file only tensors, numbers and names are taken, and nothing in it is executed.

    Raises:
      MeasurementError: if it holds anything else, or lacks a tensor.
    """
    try:
        content = read_tensors(file)
    except OSError as error:
        raise MeasurementError(f"{file}: can't be read: {error}") from error
    except ValueError as error:
        raise MeasurementError(
            f"{file}: holds more than tensors, or is no .pt file ({error}); nothing in it was executed: save"
            f" {', '.join(_NEEDED)} again as tensors alone"
        ) from error
    if missing := [name for name in _NEEDED if not isinstance(content.get(name), np.ndarray | list)]:
        kind = OtherFileError if len(missing) == len(_NEEDED) else MeasurementError
        raise kind(f"{file}: no tensor {', '.join(missing)}; it has {', '.join(map(str, content)) or 'none'}")
    try:
        time_s, position, command = (np.array(content[name], float) for name in _NEEDED)
    except (TypeError, ValueError) as error:
        raise MeasurementError(f"{file}: {', '.join(_NEEDED)} must be numbers, as many in each row") from error
    time_s, position, command = time_s.ravel(), np.atleast_2d(position.T).T, np.atleast_2d(command.T).T
    if len(time_s) != len(position) or position.shape != command.shape or position.ndim != 2:
        raise MeasurementError(
            f"{file}: time {time_s.shape}, dof_pos {position.shape}, des_dof_pos {command.shape} differ"
        )
    names: Any = content.get("joint_names", content.get("joint_order"))
    known = isinstance(names, list | tuple) and len(names) == position.shape[1]
    joints = tuple(map(str, names)) if known else tuple(f"joint_{i}" for i in range(position.shape[1]))
    notes = () if known else (f"the joints have no names in it: they are called {joints[0]} to {joints[-1]}",)
    return Recording(file.stem, joints, time_s - time_s[0], command, position, notes=notes)
