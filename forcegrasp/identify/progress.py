"""Who is told what long computations are at."""

from __future__ import annotations

from collections.abc import Callable

#: Is told in a line what is going on.
Progress = Callable[[str], None]


def silent(line: str) -> None:
    """Tells nobody."""
