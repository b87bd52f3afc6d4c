"""Parquet, strictly. What it says about its size is read before anything else, so that no file fills the memory."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import polars as pl

from forcegrasp.errors import MeasurementError
from forcegrasp.measure.folder import MAX_BYTES, MAX_ROWS, show
from forcegrasp.measure.parquet_footer import read_footer
from forcegrasp.measure.table import FileColumns, Table

_TEXT = (pl.String, pl.Categorical, pl.Enum)


def read_parquet(path: Path, columns: FileColumns) -> Table:
    """Returns the table in a Parquet file: text (or whole numbers) for names, floats or whole numbers for the rest.

    Raises:
      MeasurementError: names the row, counted from 1, and the column where it can.
    """
    footer = read_footer(path)
    if footer.rows > MAX_ROWS:
        raise MeasurementError(f"{show(path)}: {footer.rows:,} rows are more than {MAX_ROWS:,}; split it into sets")
    if footer.bytes > 2 * MAX_BYTES:
        raise MeasurementError(f"{show(path)}: {footer.bytes / 1e9:.1f} GB when unpacked; split it into several sets")
    try:
        with without_stderr():
            schema = pl.read_parquet_schema(path)
        skipped = columns.check_header(path, list(schema))
        schema = {name: kind for name, kind in schema.items() if name not in skipped}
        _check_types(path, schema, columns)
        with without_stderr():
            frame = pl.read_parquet(path, columns=list(schema), use_statistics=False)
    except MeasurementError:
        raise
    except (pl.exceptions.PolarsError, pl.exceptions.PanicException, OSError, ValueError) as error:
        problem = show(str(error).split("\n")[0], 100)
        raise MeasurementError(f"{show(path)}: not a whole Parquet file ({problem}); write it again") from error
    if frame.height != footer.rows:
        raise MeasurementError(f"{show(path)}: {frame.height} rows where its footer says {footer.rows}; write it again")
    cast = [pl.col(name).cast(pl.String if name in columns.text else pl.Float64) for name in frame.columns]
    table = Table(path, frame.select(cast), first_row=1, skipped=tuple(skipped))
    table.check_cells(columns)
    return table


@contextmanager
def without_stderr() -> Iterator[None]:
    """Keeps quiet what Rust prints before Python hears of it: Polars panics on some broken files."""
    kept, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)


def _check_types(path: Path, schema: Mapping[str, pl.DataType], columns: FileColumns) -> None:
    for name, kind in schema.items():
        if name in columns.text:
            fits, wanted = kind in _TEXT or kind.is_integer(), "text"
        else:
            fits, wanted = kind.is_float() or kind.is_integer() or kind == pl.Null, "numbers (float64)"
        if not fits:
            raise MeasurementError(f"{show(path)}: column {name}: must hold {wanted}, not {kind}; convert it")
