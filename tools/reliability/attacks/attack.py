"""An attempt to have a file do harm, and what attempts are made of."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

#: A file that must never come to be: it is what every payload wants to make.
MARK = "EXECUTED"


@dataclass(frozen=True)
class Attack:
    """What is laid out in an empty folder, and what the victim does there."""

    name: str
    lay: Callable[[], object]  #: writes the hostile files into the working directory
    fall_for: Callable[[], object]  #: reads them, with ``out`` in the working directory as the place to write to
    refused: bool = True  #: whether it must be refused; else it may be read as well
    seconds: float = 5.0


def not_files() -> Iterator[tuple[str, Callable[[Path], object]]]:
    """Things that can stand where a file is expected."""
    yield "a pipe", os.mkfifo
    yield "a device without end", lambda path: path.symlink_to("/dev/zero")
    yield "a link to itself", lambda path: path.symlink_to(path.name)
    yield "a link to nowhere", lambda path: path.symlink_to("nowhere")
    yield "a folder", Path.mkdir
    yield "a link to the process's secrets", lambda path: path.symlink_to("/proc/self/environ")


def replace(path: Path, make: Callable[[Path], object]) -> None:
    """Puts something else where a file is."""
    if path.is_dir():
        shutil.rmtree(path)
    path.unlink(missing_ok=True)
    make(path)
