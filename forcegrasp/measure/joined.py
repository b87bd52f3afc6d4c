"""What every set has in common on disk: an index of what was recorded, and the samples of all of it in one file."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import polars as pl

from forcegrasp.errors import MeasurementError, closest
from forcegrasp.measure.csv_file import read_csv
from forcegrasp.measure.folder import find_file, show
from forcegrasp.measure.parquet_file import read_parquet
from forcegrasp.measure.schema import SPLITS
from forcegrasp.measure.table import FileColumns, Table


def read_samples(folder: Path, columns: FileColumns) -> Table:
    """The samples of a set, from ``samples.csv`` or ``samples.parquet``.

    Raises:
      MeasurementError: if both are there, or the one can't be read.
    """
    both = [name for name in ("samples.csv", "samples.parquet") if os.path.lexists(folder / name)]
    if len(both) == 2:
        raise MeasurementError(f"{show(folder)}: has samples.csv and samples.parquet; remove one")
    if both == ["samples.parquet"]:
        return read_parquet(find_file(folder, "samples.parquet"), columns)
    return read_csv(find_file(folder, "samples.csv"), columns)


def check_names(index: Table, column: str) -> None:
    """Raises MeasurementError about a name that is there twice."""
    names = index.frame[column].to_list()
    for row in np.flatnonzero(index.frame[column].is_duplicated().to_numpy()).tolist():
        first = names.index(names[row])
        if first < row:
            again = f"{show(names[row])} is there already, in row {index.first_row + first}; give it another name"
            raise index.refuse(row, column, again)


def check_splits(index: Table) -> None:
    """Raises MeasurementError about a split that is unknown; the column may be left out."""
    if "split" in index.frame.columns:
        for row, split in enumerate(index.frame["split"]):
            if split and split not in SPLITS:
                problem = f"{show(split)} is unknown{closest(split, SPLITS)}; or leave it empty"
                raise index.refuse(row, "split", problem)


def samples_of_each(index: Table, samples: Table, column: str) -> dict[str, pl.DataFrame]:
    """The samples of each name in the index, with the ``row`` at which each stands; they may be interleaved.

    Raises:
      MeasurementError: if a name has no samples, or samples have no name in the index.
    """
    names = index.frame[column].to_list()
    numbered = samples.frame.with_row_index("row", offset=samples.first_row)
    parts = {str(key[0]): part for key, part in numbered.partition_by(column, as_dict=True).items()}
    for name, part in parts.items():
        if name not in set(names):
            row = int(part["row"][0]) - samples.first_row
            problem = f"{show(name)} is not in {index.path.name}{closest(name, names[:1000])}"
            raise samples.refuse(row, column, problem)
    for row, name in enumerate(names):
        if name not in parts:
            raise index.refuse(row, column, f"{show(name)} has no samples in {samples.path.name}; remove the row")
    return parts


def side_by_side(samples: Mapping[str, np.ndarray] | pl.DataFrame, names: Sequence[str]) -> np.ndarray:
    """Some columns of samples as an array, ``(T, len(names))``, which may be none."""
    values = [np.asarray(samples[name], float) for name in names]
    return np.stack(values, axis=1) if values else np.empty((len(samples["t_s"]), 0))
