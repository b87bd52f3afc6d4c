"""Reads tables of numbers, CSV or Parquet, by the names of their columns."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import numpy as np
import polars as pl

from forcegrasp.errors import MeasurementError
from forcegrasp.files.bounded import read_bytes

_MAX_BYTES = 400_000_000
_WORDS = {"true": 1.0, "false": 0.0, "": float("nan")}


def read_columns(file: Path) -> dict[str, np.ndarray]:
    """All columns that are numbers (or true and false) throughout, each ``(T,)``; text columns are left out.

    Raises:
      MeasurementError: if it can't be read, or a row has another number of cells.
    """
    try:
        rows = list(csv.reader(io.StringIO(read_bytes(file, _MAX_BYTES).decode("utf-8-sig"))))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise MeasurementError(f"{file}: can't be read: {error}") from error
    rows = [row for row in rows if row]
    if len(rows) < 3:
        raise MeasurementError(f"{file}: needs a header and at least two rows")
    header = [name.strip() for name in rows[0]]
    for number, row in enumerate(rows[1:], start=2):
        if len(row) != len(header):
            raise MeasurementError(f"{file}, row {number}: {len(row)} cells under {len(header)} names")
    found = {}
    for name, cells in zip(header, zip(*rows[1:], strict=True), strict=True):
        numbers = [_number(cell) for cell in cells]
        if None not in numbers:
            found[name] = np.array(numbers, float)
    return found


def read_parquet(file: Path) -> pl.DataFrame:
    """The table of a Parquet file.

    Raises:
      MeasurementError: if it can't be read.
    """
    try:
        return pl.read_parquet(file)
    except (OSError, pl.exceptions.PolarsError) as error:
        raise MeasurementError(f"{file}: can't be read as Parquet: {error}") from error


def _number(cell: str) -> float | None:
    word = cell.strip().lower()
    if word in _WORDS:
        return _WORDS[word]
    try:
        return float(word)
    except ValueError:
        return None
