"""Reads tables of numbers, CSV or Parquet, by the names of their columns."""

from __future__ import annotations

import csv
import io
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path

import numpy as np
import polars as pl

from forcegrasp.errors import MeasurementError
from forcegrasp.files.bounded import read_bytes
from forcegrasp.importers.recording import OtherFileError
from forcegrasp.measure.folder import show
from forcegrasp.measure.parquet_file import without_stderr
from forcegrasp.short_repr import counted

_MAX_BYTES = 400_000_000
_WORDS = {"true": 1.0, "false": 0.0} | dict.fromkeys(("", "null", "none", "na", "n/a", "#n/a"), float("nan"))
_UNITS = {"ms": 1e-3, "us": 1e-6, "ns": 1e-9}
_SEPARATORS = {",": "commas", ";": "semicolons", "\t": "tabs", " ": "spaces"}


@dataclass(frozen=True)
class Table:
    """Columns of a log, each ``(T,)``."""

    numbers: dict[str, np.ndarray]  #: numbers, true and false, or dates and times in s; NaN where a cell is empty
    texts: dict[str, list[str]] = field(default_factory=dict)  #: columns that hold anything else, as they stand there
    notes: tuple[str, ...] = ()  #: what was guessed or left out
    lines: tuple[int, ...] = ()  #: where rows stand in the file, as an editor counts; empty if it has no lines

    @property
    def rows(self) -> int:
        """How many there are."""
        return len(next(iter({**self.numbers, **self.texts}.values()), ()))

    def holds(self) -> str:
        """The names of its columns."""
        return ", ".join(name for name in (*self.numbers, *self.texts) if name) or "none"

    def why_text(self, name: str) -> str:
        """Which cell of a column of text is no number."""
        cells = self.texts[name]
        row = next((i for i, cell in enumerate(cells) if _number(cell, "") is None), 0)
        return f"{name} (row {self.lines[row] if self.lines else row + 1} has {show(cells[row], 30)})"


def read_columns(file: Path) -> Table:
    """The columns of a CSV file; cells are separated by commas, semicolons (then 0,5 is a half), tabs or spaces.

    Lines that begin with # are left out, but the last of them is the header where no other is there; and so is a last
    line that was cut short.

    Raises:
      MeasurementError: if it can't be read, or a row has another number of cells.
    """
    try:
        content = read_bytes(file, _MAX_BYTES)
    except OSError as error:
        raise MeasurementError(f"{file}: can't be read: {error}") from error
    text, notes = _decoded(content, file)
    above = text.startswith("sep=")  # a word of one spreadsheet to itself
    text = text.partition("\n")[2] if above else text
    first = next((line for line in text.splitlines() if line.strip() and not line.startswith("#")), "")
    # a semicolon weighs twice, for the commas beside it are those of numbers; and spaces stand beside any other
    there = [separator for separator in _SEPARATORS if separator in first.strip()]
    separator = max(there, key=lambda s: (s != " ", first.count(s) * (2 if s == ";" else 1)), default=",")
    try:
        lines = csv.reader(io.StringIO(text, newline=None), delimiter=separator, skipinitialspace=True)
        numbered = [(lines.line_num + above, row) for row in lines if any(cell.strip() for cell in row)]
    except csv.Error as error:
        raise MeasurementError(f"{file}: can't be read: {error}") from error
    hidden = [row for _, row in numbered if row[0].startswith("#")]
    numbered = [(line, row) for line, row in numbered if not row[0].startswith("#")]
    rows = [row[:-1] if separator == " " and not row[-1] else row for _, row in numbered]
    at = [line for line, _ in numbered]
    if hidden and rows and all(_number(cell, separator) is not None for cell in rows[0]):
        names = [cell for cell in (hidden[-1][0].lstrip("#"), *hidden[-1][1:]) if cell.strip()]
        if len(names) == len(rows[0]):  # as numpy.savetxt writes it
            rows.insert(0, names)
            at.insert(0, 0)
    if len(rows) < 3:
        raise OtherFileError(f"{file}: needs a header and at least two rows")
    header = [name.strip() for name in rows[0]]
    if separator != ",":
        notes.append(f"{file.name}: its cells are separated by {_SEPARATORS[separator]}")
    if len(rows[-1]) < len(header):
        notes.append(f"{file.name}: left out the last line, which was cut short")
        rows.pop()
    for line, row in zip(at[1:], rows[1:], strict=False):
        while len(row) > len(header) and not row[-1].strip():
            row.pop()  # a separator at the end of each line
        if len(row) != len(header):
            raise MeasurementError(f"{file}, row {line}: {counted(len(row), 'cell')} under {len(header)} names")
    if twice := sorted({name for name in header if name and header.count(name) > 1}):
        raise MeasurementError(f"{file}: {', '.join(twice)}: two columns have this name; rename one")
    numbers, texts = {}, {}
    for name, cells in zip(header, zip(*rows[1:], strict=True), strict=True):
        values = _values(cells, separator)
        if values is None:
            texts[name] = list(cells)
        else:
            numbers[name] = values
    return Table(numbers, texts, tuple(notes), tuple(at[1 : len(rows)]))


def read_parquet(file: Path, only: Collection[str] | None = None) -> pl.DataFrame:
    """The table of a Parquet file, or only those of some columns that it has.

    Raises:
      MeasurementError: if it can't be read.
    """
    try:
        content = read_bytes(file, _MAX_BYTES)
        with without_stderr():
            there = pl.read_parquet_schema(io.BytesIO(content))
            return pl.read_parquet(io.BytesIO(content), columns=[n for n in there if only is None or n in only])
    except (OSError, pl.exceptions.PolarsError, pl.exceptions.PanicException) as error:  # a broken file may panic
        reason = " ".join(str(error).split())
        raise MeasurementError(f"{file}: can't be read as Parquet: {reason}") from error


def parquet_columns(file: Path) -> Table:
    """The columns of a Parquet file; of a list in each row, ``name[0]``, ``name[1]`` and so on.

    Raises:
      MeasurementError: if it can't be read.
    """
    frame = read_parquet(file)
    numbers, texts = {}, {}
    for name, kind in frame.schema.items():
        column = frame[name]
        if isinstance(kind, pl.Datetime | pl.Duration):
            column = column.cast(pl.Int64).cast(pl.Float64) * _UNITS[kind.time_unit]
        elif isinstance(kind, pl.Array):
            column = column.arr.to_list()
        if isinstance(column.dtype, pl.List) and column.dtype.inner.is_numeric():
            wide = column.list.len().max()
            parts = {f"{name}[{i}]": column.list.get(i, null_on_oob=True) for i in range(int(str(wide or 0)))}
        else:
            parts = {name: column}
        for part, values in parts.items():
            if values.dtype.is_numeric() or values.dtype == pl.Boolean:
                numbers[part] = values.cast(pl.Float64).fill_null(np.nan).to_numpy()
            else:
                cells = values.fill_null("").to_list() if kind == pl.String else [str(kind)] * len(frame)
                if (read := _values(cells, "")) is None:
                    texts[part] = cells
                else:
                    numbers[part] = read
    return Table(numbers, texts)


def _decoded(content: bytes, file: Path) -> tuple[str, list[str]]:
    for encoding in ("utf-16" if content[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig", "cp1252"):
        try:
            text = content.decode(encoding)
        except UnicodeDecodeError:
            continue
        if "\0" not in text:
            return text, [] if encoding == "utf-8-sig" else [f"{file.name}: is read as {encoding}"]
    raise MeasurementError(f"{file}: can't be read: it is no text")


def _values(cells: Sequence[str], separator: str) -> np.ndarray | None:
    """Numbers, or seconds of dates and times; None if any cell is neither."""
    values = [_number(cell, separator) for cell in cells]
    if None in values:
        values = [_seconds(cell) for cell in cells]
    return None if None in values else np.array(values, float)


def _seconds(cell: str) -> float | None:
    """Seconds of a date and time as ISO 8601 has it."""
    try:
        return datetime.fromisoformat(cell.strip()).timestamp()
    except ValueError:
        return None


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
