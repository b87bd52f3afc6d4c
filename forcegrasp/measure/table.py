"""A table of named columns with the place of every cell, whatever file it came from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import polars as pl

from forcegrasp.errors import MeasurementError
from forcegrasp.measure.folder import MAX_NAME, show
from forcegrasp.measure.names import misfits


@dataclass(frozen=True)
class FileColumns:
    """The columns that a file may have."""

    text: tuple[str, ...]
    numbers: tuple[str, ...]
    optional: tuple[str, ...] = ()  #: need not be there
    blank: tuple[str, ...] = ()  #: may have empty cells

    def check_header(self, path: Path, names: Sequence[str], row: str = "") -> list[str]:
        """Returns the columns to skip: unknown ones that are no misspelling of one that could be there.

        Raises:
          MeasurementError: about all columns that are missing, misspelt, without a name or there twice.
        """
        known = self.text + self.numbers
        if len(names) == 1 and any(mark in names[0] for mark in ";\t|"):
            raise MeasurementError(f"{show(path)}:{row} columns must be separated by commas; save it as plain CSV")
        required = [name for name in known if name not in self.optional]
        problem = misfits("column", names, required, self.optional, more=True)
        if problem:
            raise MeasurementError(f"{show(path)}:{row} {problem}")
        return [name for name in names if name not in known]


@dataclass(frozen=True)
class Table:
    """FileColumns of a file: text as pl.String and numbers as pl.Float64."""

    path: Path
    frame: pl.DataFrame
    first_row: int  #: what an editor (CSV) or a viewer (Parquet) shows as the number of the first row of data
    skipped: tuple[str, ...] = ()  #: unknown columns of the file, which are not in the frame

    def notes(self) -> tuple[str, ...]:
        """What the user should know about columns that were skipped, in a line."""
        names = ", ".join(show(name) for name in self.skipped)
        return (f"{show(self.path)}: unknown columns are skipped: {names}",) if names else ()

    def refuse(self, index: int, column: str, problem: str) -> MeasurementError:
        """The error to raise about one cell; ``index`` counts rows from 0."""
        return MeasurementError(f"{show(self.path)}: row {self.first_row + index}, column {column}: {problem}")

    def check_cells(self, columns: FileColumns) -> None:
        """Raises MeasurementError about the first cell that is empty, not finite, or no proper name."""
        if not self.frame.height:
            raise MeasurementError(f"{show(self.path)}: holds no rows; fill it or remove the set")
        for name, cells in self.frame.to_dict().items():
            empty = cells.is_null() if name in columns.numbers else cells.is_null() | (cells == "")
            if name not in columns.blank and empty.any():
                raise self.refuse(_first(empty), name, "is empty; fill it in")
            if name in columns.numbers:
                wrong = ~cells.is_finite().fill_null(True)
                if wrong.any():
                    raise self.refuse(_first(wrong), name, f"{cells[_first(wrong)]} is no finite number; drop the row")
            else:
                for value in cells.unique(maintain_order=True).drop_nulls():
                    problem = _problem_of_name(value)
                    if problem:
                        raise self.refuse(_first(cells == value), name, problem)


def _first(mask: pl.Series) -> int:
    return int(np.flatnonzero(mask.fill_null(False).to_numpy())[0])


def _problem_of_name(value: str) -> str:
    if len(value) > MAX_NAME:
        return f"{show(value)} has {len(value)} characters; {MAX_NAME} may be used"
    if not value.isprintable():
        return f"{show(value)} holds characters that can't be printed; remove them"
    if value != value.strip():
        return f"{show(value)} has spaces at its ends; remove them"
    return ""
