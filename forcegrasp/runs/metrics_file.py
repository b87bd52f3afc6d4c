"""A run's ``metrics.csv``: a row for each batch, the number of frames first."""

from __future__ import annotations

import csv
import io
from pathlib import Path

from forcegrasp.files.whole_file import write_whole


def append_row(path: Path, row: dict[str, float]) -> None:
    """Appends a row; the first one decides the columns."""
    new = not path.exists()
    with open(path, "a", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, fieldnames=list(row))
        if new:
            writer.writeheader()
        writer.writerow(row)


def drop_rows_after(path: Path, frames: int) -> None:
    """Keeps the whole rows up to a checkpoint, so that a resumed run logs nothing twice and mends a torn line."""
    if not path.exists():
        return
    with open(path, encoding="utf-8", newline="") as file:
        header, *lines = list(csv.reader(file.read().replace("\0", "").splitlines())) or [[]]
    kept = [line for line in lines if len(line) == len(header) and line[0].isdigit() and int(line[0]) <= frames]
    if not kept:  # the header may be torn, too; the next row writes it anew
        path.unlink()
        return
    text = io.StringIO(newline="")
    csv.writer(text).writerows([header, *kept])
    write_whole(path, text.getvalue().encode())
