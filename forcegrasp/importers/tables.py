"""Reads tables of numbers, CSV or Parquet, by the names of their columns."""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import polars as pl

from forcegrasp.errors import MeasurementError
from forcegrasp.files.bounded import read_bytes
from forcegrasp.measure.folder import show
from forcegrasp.short_repr import counted

_MAX_BYTES = 400_000_000
_WORDS = {"true": 1.0, "false": 0.0, "": float("nan"), "null": float("nan"), "none": float("nan")}
_SEPARATORS = {",": "commas", ";": "semicolons", "\t": "tabs"}


@dataclass(frozen=True)
class Table:
    """Columns of a log, each ``(T,)``."""

    numbers: dict[str, np.ndarray]  #: numbers, or true and false; NaN where a cell is empty
    texts: dict[str, str] = field(default_factory=dict)  #: columns that hold anything else → the first that is none
    notes: tuple[str, ...] = ()  #: what was guessed or left out

    @property
    def rows(self) -> int:
        """How many there are."""
        return len(next(iter(self.numbers.values()), ()))


def read_columns(file: Path) -> Table:
    """The columns of a CSV file; cells are separated by commas, semicolons (then 0,5 is a half) or tabs.

    Lines before the header that begin with # are left out, and so is a last line that was cut short.

    Raises:
      MeasurementError: if it can't be read, or a row has another number of cells.
    """
    try:
        text = read_bytes(file, _MAX_BYTES).decode("utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise MeasurementError(f"{file}: can't be read: {error}") from error
    first = next((line for line in text.splitlines() if line.strip() and not line.startswith("#")), "")
    separator = max(_SEPARATORS, key=first.count)
    try:
        rows = [row for row in csv.reader(io.StringIO(text), delimiter=separator) if any(cell.strip() for cell in row)]
    except csv.Error as error:
        raise MeasurementError(f"{file}: can't be read: {error}") from error
    rows = [row for row in rows if not row[0].startswith("#")]
    if len(rows) < 3:
        raise MeasurementError(f"{file}: needs a header and at least two rows")
    header, notes = [name.strip() for name in rows[0]], []
    if separator != ",":
        notes.append(f"{file.name}: its cells are separated by {_SEPARATORS[separator]}")
    if len(rows[-1]) < len(header):
        notes.append(f"{file.name}: left out the last line, which was cut short")
        rows.pop()
    for number, row in enumerate(rows[1:], start=2):
        if len(row) != len(header):
            raise MeasurementError(f"{file}, row {number}: {counted(len(row), 'cell')} under {len(header)} names")
    if twice := sorted({name for name in header if header.count(name) > 1}):
        raise MeasurementError(f"{file}: {', '.join(twice)}: two columns have this name; rename one")
    numbers, texts = {}, {}
    for name, cells in zip(header, zip(*rows[1:], strict=True), strict=True):
        values = [_number(cell, separator) for cell in cells]
        if None in values:
            row = values.index(None)
            texts[name] = f"row {row + 2} has {show(cells[row], 30)}"
        else:
            numbers[name] = np.array(values, float)
    return Table(numbers, texts, tuple(notes))


def read_parquet(file: Path) -> pl.DataFrame:
    """The table of a Parquet file.

    Raises:
      MeasurementError: if it can't be read.
    """
    try:
        return pl.read_parquet(file)
    except (OSError, pl.exceptions.PolarsError) as error:
        raise MeasurementError(f"{file}: can't be read as Parquet: {error}") from error


def parquet_columns(file: Path) -> Table:
    """The columns of a Parquet file.

    Raises:
      MeasurementError: if it can't be read.
    """
    frame = read_parquet(file)
    kept = [name for name, kind in frame.schema.items() if kind.is_numeric() or kind == pl.Boolean]
    others = {name: str(kind) for name, kind in frame.schema.items() if name not in kept}
    return Table({name: frame[name].cast(pl.Float64).fill_null(np.nan).to_numpy() for name in kept}, others)


def _number(cell: str, separator: str) -> float | None:
    word = cell.strip().lower()
    if word in _WORDS:
        return _WORDS[word]
    if separator != ",":
        word = word.replace(",", ".")
    try:
        return float(word)
    except ValueError:
        return None
