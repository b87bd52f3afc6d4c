"""What must hold for the samples of every grasp, wherever they come from."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from forcegrasp.errors import MeasurementError
from forcegrasp.measure.folder import show
from forcegrasp.measure.schema import MeasuredGrasp

MIN_SAMPLES = 10


def samples_file(path: Path) -> str:
    """The file of the samples, for messages; the set itself if they are in no file."""
    names = [name for name in ("samples.parquet", "samples.csv") if (path / name).is_file()]
    return show(path / names[0]) if names else show(path)


def place(path: Path, grasp: MeasuredGrasp, index: int | None = None, column: str = "") -> str:
    """Where a sample of a grasp stands, for messages: the file, row and column, or the grasp and time if in no file."""
    where = [f"{samples_file(path)}: {'grasp' if grasp.object else 'recording'} {show(grasp.name)}"]
    if index is not None:
        where.append(f"row {grasp.rows[index]}" if grasp.rows is not None else f"t_s={grasp.time_s[index]:.9g}")
    return ", ".join([*where, f"column {column}"] if column else where)


def check_samples(path: Path, grasp: MeasuredGrasp) -> None:
    """Raises MeasurementError if shapes differ, a number is not finite, or time does not run forward."""
    count = len(grasp.time_s)
    columns = grasp.columns
    widths = [(grasp.command_m, columns.command), (grasp.position_m, columns.position), (grasp.force_n, columns.force)]
    others = [grasp.object_m] if grasp.object_m is not None else []
    if any(np.shape(values) != (count, len(names)) for values, names in widths) or any(
        np.shape(other) != (count,) for other in others
    ):
        raise MeasurementError(f"{place(path, grasp)}: its signals must have one row per time stamp")
    if not count:
        raise MeasurementError(f"{place(path, grasp)}: has no samples; add them or remove the grasp")
    for column, values in grasp.signals().items():
        wrong = ~np.isfinite(values)
        if wrong.any():
            index = int(wrong.argmax())
            raise MeasurementError(f"{place(path, grasp, index, column)}: {values[index]} is no finite number")
    late = np.diff(grasp.time_s) <= 0
    if late.any():
        index = int(late.argmax())
        before, after = grasp.time_s[index : index + 2].tolist()
        if before > after:
            problem = f"time runs back, from {before!r} to {after!r}; sort the rows by time, or correct the clock"
        elif all(values[index] == values[index + 1] for values in grasp.signals().values()):
            problem = "the same row again; remove it"
        else:
            problem = f"the time {after!r} is there twice; each sample needs its own"
        raise MeasurementError(f"{place(path, grasp, index + 1, 't_s')}: {problem}")
