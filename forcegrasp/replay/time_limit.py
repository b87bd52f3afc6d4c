"""A time after which computations end, wherever they are, with what was found by then."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

from forcegrasp.errors import ForcegraspError

# When the time is over, s of the clock that never goes back; and how long it was, min.
_LIMIT: ContextVar[tuple[float, float]] = ContextVar("_LIMIT", default=(math.inf, math.inf))


class OutOfTimeError(ForcegraspError):
    """The time is over.

    Args:
      minutes: that there were.
    """

    def __init__(self, minutes: float) -> None:
        self.words = f"its {minutes:g} min were over"
        super().__init__(f"{minutes:g} min were over before the base model was fitted; give it more (minutes=)")


@contextmanager
def time_limit(minutes: float) -> Iterator[None]:
    """Lets simulations that are begun within it fail once so many minutes are over; 0 is no limit."""
    before = _LIMIT.set((time.monotonic() + 60 * minutes, minutes) if minutes else (math.inf, math.inf))
    try:
        yield
    finally:
        _LIMIT.reset(before)


def check_time() -> None:
    """Ends what goes on too long.

    Raises:
      OutOfTimeError: if the time is over.
    """
    end, minutes = _LIMIT.get()
    if time.monotonic() > end:
        raise OutOfTimeError(minutes)


def lift_time_limit() -> None:
    """Gives what is left to do, now that the rest is cut short, all the time that it takes."""
    _LIMIT.set((math.inf, math.inf))
