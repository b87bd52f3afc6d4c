"""What runs have learned so far, as far as metrics.csv tells: found below a folder, read, and checked."""

from __future__ import annotations

import csv
import dataclasses
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from forcegrasp.config import TrainConfig
from forcegrasp.errors import CheckpointError
from forcegrasp.files import plain_yaml
from forcegrasp.files.bounded import read_bytes
from forcegrasp.runs.provenance import experiment

#: A row is half a kB, and a batch takes a second.
MAX_METRICS_BYTES = 200_000_000
#: The option that says how long a training is.
TOTAL_FRAMES = f"{TrainConfig().algorithm.name}.total_frames"


@dataclass
class History:
    """A training as far as it got.

    Attributes:
      options: the whole configuration, dotted name → value.
      frames: ``(n,)``, after each batch.
      values: column → ``(n,)``.
    """

    path: Path
    experiment: str
    options: dict[str, Any]
    frames: np.ndarray
    values: dict[str, np.ndarray]

    @property
    def seed(self) -> int:
        return self.options["seed"]

    @property
    def total(self) -> int:
        return self.options[TOTAL_FRAMES]

    @property
    def finished(self) -> bool:
        return bool(self.frames[-1] >= self.total)


def find_histories(folders: list[Path], columns: list[str]) -> tuple[list[History], list[str]]:
    """Reads these columns of all runs in and below some folders.

    Returns:
      The runs, and a line for each one that is left out.

    Raises:
      CheckpointError: if a folder holds no run that has begun to train, or a run can't be read.
    """
    runs: dict[Path, History] = {}
    notes = []
    for folder in folders:
        if not folder.is_dir():
            raise CheckpointError(f"{folder}: no such folder")
        found = sorted(path.parent for path in folder.rglob("config.yaml") if _is_run(path.parent))
        read = {path: read_history(path, columns) for path in found}
        notes += [f"{path} has not finished a batch yet" for path, run in read.items() if run is None]
        begun = {path.resolve(): run for path, run in read.items() if run is not None}
        if not begun:
            what = "no run in it has finished a batch yet" if found else "no run in it"
            raise CheckpointError(f"{folder}: {what}; a run is what forcegrasp train wrote")
        runs |= begun
    return list(runs.values()), notes


def _is_run(path: Path) -> bool:
    return any((path / name).is_file() for name in ("run.json", "metrics.csv"))


def read_history(path: Path, columns: list[str]) -> History | None:
    """Reads a run's progress; None if it has not finished its first batch.

    Raises:
      CheckpointError: if it can't be read.
    """
    metrics = path / "metrics.csv"
    options = _options(path / "config.yaml")
    try:
        text = read_bytes(metrics, MAX_METRICS_BYTES).decode()
    except FileNotFoundError:
        return None
    except (OSError, UnicodeDecodeError) as error:
        raise CheckpointError(f"{metrics}: can't be read ({error})") from error
    whole = text[: text.rfind("\n") + 1]  # a run at work, or one that was killed, may leave a torn line
    header, *lines = list(csv.reader(whole.splitlines())) or [[]]
    if not lines:
        return None
    table = {}
    for column in ("frames", *columns):
        if column not in header:
            raise CheckpointError(f"{metrics}: no column {column!r}; was it written by forcegrasp train?")
        index = header.index(column)
        table[column] = np.array([_number(metrics, row, line, index, column) for row, line in enumerate(lines, 2)])
    frames = table.pop("frames")
    if (np.diff(frames, prepend=0) <= 0).any():
        row = 2 + int(np.argmax(np.diff(frames, prepend=0) <= 0))
        raise CheckpointError(f"{metrics}: line {row}: frames do not grow; the file is damaged")
    return History(path, experiment(path), options, frames, table)


def _number(path: Path, row: int, line: list[str], index: int, column: str) -> float:
    try:
        value = float(line[index])
    except (IndexError, ValueError):
        value = math.nan
    if not math.isfinite(value):
        said = repr(line[index]) if index < len(line) else "nothing"
        raise CheckpointError(f"{path}: line {row}: {column} is {said}, not a number; the file is damaged")
    return value


def _options(path: Path) -> dict[str, Any]:
    """A run's configuration, flat; options that are newer than the run have their defaults."""
    try:
        loaded = plain_yaml.load(path)
    except (OSError, plain_yaml.PlainYamlError) as error:
        raise CheckpointError(f"{path}: not a valid configuration ({str(error).splitlines()[0]})") from error
    if not isinstance(loaded, dict):
        raise CheckpointError(f"{path}: not a valid configuration (no options in it)")
    options = flat(dataclasses.asdict(TrainConfig())) | flat(loaded)
    if not all(isinstance(options[name], int) for name in ("seed", TOTAL_FRAMES)):
        raise CheckpointError(f"{path}: not a valid configuration (seed and {TOTAL_FRAMES} must be integers)")
    return options


def flat(options: dict[str, Any], prefix: str = "") -> dict[str, Any]:
    """Nested options by their dotted names."""
    found = {}
    for name, value in options.items():
        found |= flat(value, f"{prefix}{name}.") if isinstance(value, dict) else {f"{prefix}{name}": value}
    return found
