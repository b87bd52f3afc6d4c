"""What the measuring verbs share: where results go, what is printed while they work."""

from __future__ import annotations

import json
import math
import shutil
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from forcegrasp.errors import ConfigError, writing

if TYPE_CHECKING:
    from rich.table import Table

# Wider than any table; and how wide one is that goes to a file or a pipe.
_WIDEST, _IN_A_FILE = 10_000, 120


def default_out(verb: str, out: str) -> Path:
    """The folder that was asked for, or a new run directory's."""
    return Path(out) if out else Path(f"runs/{verb}_{time.strftime('%Y-%m-%d_%H-%M-%S')}")


def need(value: str, option: str, example: str) -> Path:
    """A path that must be given.

    Raises:
      ConfigError: if it is empty.
    """
    if not value.strip():
        raise ConfigError(f"{option} is missing: {option}={example}")
    return Path(value)


def need_sets(data: list[str]) -> list[Path]:
    """The folders of the measurement sets.

    Raises:
      ConfigError: if there are none.
    """
    return [need(one, "data", "my_set") for one in data or [""]]


def progress_printer() -> Callable[[str], None]:
    """Prints what is going on, with the seconds since the start."""
    start = time.monotonic()

    def show(text: str) -> None:
        print(f"  [{time.monotonic() - start:4.0f} s] {text}", flush=True)

    return show


def print_table(table: Table) -> None:
    """Prints a table in which no name is cut off: cells wrap between words; lines that are still too wide run on."""
    from rich.cells import cell_len
    from rich.console import Console
    from rich.measure import Measurement

    console = Console(highlight=False, width=shutil.get_terminal_size((_IN_A_FILE, 0)).columns)
    texts = [[str(column.header), *map(str, column.cells)] for column in table.columns]
    widths = [max(map(cell_len, column)) for column in texts]
    least = [max(map(cell_len, " ".join(column).split()), default=0) for column in texts]
    frame = Measurement.get(console, console.options.update(width=_WIDEST), table).maximum - sum(widths)
    while sum(widths) + frame > console.width and widths != least:
        widest = max(range(len(widths)), key=lambda k: widths[k] if widths[k] > least[k] else 0)
        widths[widest] -= 1
    for column, width in zip(table.columns, widths, strict=True):
        column.width = width
    console.width = max(console.width, sum(widths) + frame)
    console.print(table)


def write_json(path: Path, content: dict[str, Any]) -> None:
    """Writes a result; numbers that are not finite become null.

    Raises:
      ConfigError: if the file can't be written.
    """
    with writing(path.parent):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(_finite(content), indent=2, ensure_ascii=False, allow_nan=False) + "\n", "utf-8")


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(key): _finite(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(item) for item in value]
    if isinstance(value, float) or hasattr(value, "dtype"):
        number = float(value)
        return number if math.isfinite(number) else None
    return value
