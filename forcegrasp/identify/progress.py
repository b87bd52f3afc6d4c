"""How long computations report what they do."""

from __future__ import annotations

from collections.abc import Callable

#: Takes a line about what is done now.
Progress = Callable[[str], None]


def silent(line: str) -> None:
    """Reports nothing."""
