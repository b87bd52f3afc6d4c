"""Reads files that others may have made: ordinary ones, up to a size. A pipe would block, and a device never ends."""

from __future__ import annotations

import errno
from pathlib import Path


def read_bytes(path: Path, max_bytes: int) -> bytes:
    """Returns what a file holds.

    Raises:
      OSError: if it can't be read, is no ordinary file, larger than ``max_bytes``, or only a pointer of Git LFS.
    """
    if path.exists() and not path.is_file() and not path.is_dir():
        raise OSError(errno.EINVAL, "not an ordinary file", str(path))
    with open(path, "rb") as file:
        data = file.read(max_bytes + 1)
    if len(data) > max_bytes:
        raise OSError(errno.EFBIG, f"larger than {max_bytes // 1000:,} kB", str(path))
    if data.startswith(b"version https://git-lfs.github.com/spec"):
        raise OSError(errno.EINVAL, "Git LFS left only a pointer to it here; fetch it with: git lfs pull", str(path))
    return data
