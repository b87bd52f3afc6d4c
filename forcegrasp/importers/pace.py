"""Recordings of PACE (github.com/leggedrobotics/pace-sim2real): tensors time, dof_pos and des_dof_pos in a .pt file."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np

from forcegrasp.errors import MeasurementError
from forcegrasp.files.bounded import read_bytes
from forcegrasp.importers.recording import Recording

MECHANISM = ""  #: none that comes with the package
_MAX_BYTES = 1_000_000_000
_NEEDED = ("time", "dof_pos", "des_dof_pos")


def find(source: Path) -> list[Path]:
    """Files of recordings at or below a folder, or the file itself."""
    return [source] if source.is_file() else sorted(source.glob("**/*.pt"))


def read(file: Path) -> Recording:
    """Reads one recording; of the file only tensors, numbers and names are taken, and nothing in it is executed.

    Raises:
      MeasurementError: if it holds anything else, or lacks a tensor.
    """
    import torch

    try:
        content: Any = torch.load(io.BytesIO(read_bytes(file, _MAX_BYTES)), map_location="cpu", weights_only=True)
    except Exception as error:  # torch raises whatever its reader meets
        raise MeasurementError(
            f"{file}: holds more than tensors, or is no .pt file: nothing in it was executed"
        ) from error
    there = sorted(content) if isinstance(content, dict) else []
    if missing := [name for name in _NEEDED if name not in there or not isinstance(content[name], torch.Tensor)]:
        raise MeasurementError(f"{file}: no tensor {', '.join(missing)}; it has {', '.join(map(str, there)) or 'none'}")
    time_s, position, command = (content[name].double().numpy() for name in _NEEDED)
    position, command = (np.atleast_2d(a.T).T for a in (position, command))
    if not len(time_s) == len(position) == len(command) or position.shape != command.shape:
        raise MeasurementError(
            f"{file}: time {time_s.shape}, dof_pos {position.shape}, des_dof_pos {command.shape} differ"
        )
    names: Any = content.get("joint_names")
    known = isinstance(names, list | tuple) and len(names) == position.shape[1]
    joints = tuple(map(str, names)) if known else tuple(f"joint_{i}" for i in range(position.shape[1]))
    notes = () if known else (f"the joints have no names in it: they are called {joints[0]} to {joints[-1]}",)
    return Recording(file.stem, joints, time_s - time_s[0], command, position, notes=notes)
