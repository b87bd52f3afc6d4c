"""CSV, strictly. Polars reads it fast; if it stumbles, or leaves a cell empty, every line is looked at to say where."""

from __future__ import annotations

import codecs
import csv
import re
from pathlib import Path

import polars as pl

from forcegrasp.errors import MeasurementError
from forcegrasp.measure.folder import MAX_ROWS, show
from forcegrasp.measure.table import FileColumns, Table

_CHUNK = 1 << 24
_MAX_LINE = 10_000
_QUOTED = re.compile(r'("([^"]|"")*"|[^",]*)(,("([^"]|"")*"|[^",]*))*')
_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?|[-+]?(nan|inf|infinity)", re.ASCII | re.IGNORECASE)


def read_csv(path: Path, columns: FileColumns) -> Table:
    """Returns the table in a CSV file: UTF-8, commas, decimal points, a header, one row per line.

    Raises:
      MeasurementError: names the row, as an editor counts lines, and the column where it can.
    """
    try:
        rows = _count_rows(path) - 1
        header, skipped = _header(path, columns)
        schema = {name: pl.Float64 if name in columns.numbers else pl.String for name in header}
        frame, problem = None, ""
        try:
            frame = pl.read_csv(path, schema=schema).head(rows).drop(skipped)
            problem = "rows and line ends don't match" if frame.height != rows else ""
        except pl.exceptions.PolarsError as error:
            problem = str(error).split("\n")[0]
        if frame is None or problem or any(frame.null_count().row(0)):
            _inspect(path, header, columns)
        if frame is None or problem:
            raise MeasurementError(f"{show(path)}: not CSV that can be read: {show(problem, 100)}")
    except OSError as error:
        raise MeasurementError(f"{show(path)}: not readable ({error.strerror})") from error
    table = Table(path, frame, first_row=2, skipped=tuple(skipped))
    table.check_cells(columns)
    return table


def _count_rows(path: Path) -> int:
    """Returns the number of lines up to the last that is not empty, after checking the bytes."""
    decode = codecs.getincrementaldecoder("utf-8")().decode
    lines = breaks = length = 0
    line = b""
    with open(path, "rb") as file:
        while chunk := file.read(_CHUNK):
            if not breaks and chunk.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
                raise MeasurementError(f"{show(path)}: row 1: not UTF-8 but UTF-16; save the file as UTF-8")
            try:
                decode(chunk)
            except UnicodeDecodeError as error:
                row = breaks + error.object.count(b"\n", 0, error.start) + 1
                raise MeasurementError(f"{show(path)}: row {row}: not UTF-8; save the file as UTF-8") from error
            if b"\0" in chunk:
                row = breaks + chunk.count(b"\n", 0, chunk.index(b"\0")) + 1
                raise MeasurementError(f"{show(path)}: row {row}: holds a NUL byte; is this a CSV file?")
            for line in chunk.split(b"\n"):
                length += len(line)
                if length > _MAX_LINE:
                    raise MeasurementError(
                        f"{show(path)}: row {breaks + 1}: longer than {_MAX_LINE} bytes; is this a CSV file?"
                    )
                if line.strip(b"\r"):
                    lines = breaks + 1
                breaks, length = breaks + 1, 0
            breaks, length = breaks - 1, len(line)  # the last one goes on in the next chunk
            if lines - 1 > MAX_ROWS:
                raise MeasurementError(f"{show(path)}: more than {MAX_ROWS:,} rows; split it into several sets")
    try:
        decode(b"", True)
    except UnicodeDecodeError as error:
        raise MeasurementError(f"{show(path)}: row {breaks + 1}: ends within a character; copy it again") from error
    if not lines:
        raise MeasurementError(f"{show(path)}: empty; a header and rows must be there")
    return lines


def _header(path: Path, columns: FileColumns) -> tuple[list[str], list[str]]:
    """Returns the columns, and those of them that are to be skipped."""
    with open(path, encoding="utf-8-sig", newline="\n") as file:
        line = file.readline().removesuffix("\n").removesuffix("\r")
    if "\r" in line:
        raise MeasurementError(f"{show(path)}: row 1: lines end with CR alone; save the file with LF or CRLF")
    header = _cells(path, 1, line)
    return header, columns.check_header(path, header, " row 1:")


def _cells(path: Path, row: int, line: str) -> list[str]:
    if '"' in line and not _QUOTED.fullmatch(line):
        raise MeasurementError(
            f"{show(path)}: row {row}: a quotation mark is not closed or stands within a cell; correct it"
        )
    try:
        return next(csv.reader([line]), [""])
    except csv.Error as error:  # a carriage return in the middle
        raise MeasurementError(f"{show(path)}: row {row}: not a row of cells ({error}); correct it") from error


def _inspect(path: Path, header: list[str], columns: FileColumns) -> None:
    """Raises MeasurementError about the first line that is no row, or the first cell that is no number."""
    blank = 0
    with open(path, encoding="utf-8-sig", newline="\n") as file:
        for row, line in enumerate(file, 1):
            line = line.removesuffix("\n").removesuffix("\r")
            if not line:  # empty lines may stand at the end, only
                blank = blank or row
                continue
            if blank:
                raise MeasurementError(f"{show(path)}: row {blank}: empty; remove it")
            cells = _cells(path, row, line)
            if len(cells) != len(header):
                raise MeasurementError(
                    f"{show(path)}: row {row}: has {len(cells)} cells where the header has {len(header)} columns;"
                    " decimals take a point, and names with commas quotation marks"
                )
            for name, cell in zip(header, cells, strict=True):
                if row > 1 and name in columns.numbers and cell and not _NUMBER.fullmatch(cell.strip(" ")):
                    raise MeasurementError(
                        f"{show(path)}: row {row}, column {name}: {show(cell)} is not a number; write it like 0.0123"
                    )
                if row > 1 and name in columns.numbers and cell.endswith(" "):
                    raise MeasurementError(
                        f"{show(path)}: row {row}, column {name}: {show(cell)} ends with a space; remove it"
                    )
