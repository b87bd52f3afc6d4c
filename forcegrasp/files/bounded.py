"""Reads files that others may have made: ordinary ones, up to a size. A pipe would block, and a device never ends."""

from __future__ import annotations

import errno
from pathlib import Path


def read_bytes(path: Path, max_bytes: int) -> bytes:
    """Returns what a file holds.

    Raises:
      OSError: if it can't be read, is no ordinary file, or larger than ``max_bytes``.
    """
    if path.exists() and not path.is_file() and not path.is_dir():
        raise OSError(errno.EINVAL, "not an ordinary file", str(path))
    with open(path, "rb") as file:
        data = file.read(max_bytes + 1)
    if len(data) > max_bytes:
        raise OSError(errno.EFBIG, f"larger than {max_bytes // 1000:,} kB", str(path))
    return data
