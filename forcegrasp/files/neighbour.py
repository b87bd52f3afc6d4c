"""Paths that files say of others: relative where both lie in one folder, so that it can be moved as a whole."""

from __future__ import annotations

import os
from pathlib import Path


def seen_from(folder: Path, name: str, within: Path) -> str:
    """Returns a path as a file in a folder may say it.

    Args:
      folder: where the file is, and where a relative path in it starts.
      name: an absolute path; anything else is returned as it is.
      within: only what lies in here is named relative to the file.
    """
    path = Path(name)
    if not path.is_absolute() or not path.is_relative_to(within.resolve()):
        return name
    relative = os.path.relpath(path, folder.resolve())
    return relative if os.sep in relative or path.suffix else os.path.join(os.curdir, relative)  # a word is a name
