"""What a program that measures reliability yields: one trial after the other."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass


@dataclass(frozen=True)
class Trial:
    """One attempt to break a promise."""

    name: str  #: what was tried, enough to repeat it
    failure: str = ""  #: how the promise was broken; empty if it was kept
    kind: str = ""  #: what it came to, for the summary


@dataclass(frozen=True)
class Promise:
    """A promise and the program that tries to break it."""

    text: str
    trials: int  #: of the figure in docs/reliability.md
    few: int  #: of the small version that is part of the tests; 0 if there is none
    run: Callable[[int, int], Iterator[Trial]]  #: (trials, seed) → trials, as many or more
