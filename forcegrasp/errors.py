"""Errors a user can act on: each message says what is wrong, where, and what to do, in one line."""

from __future__ import annotations

import difflib
from collections.abc import Generator, Iterable
from contextlib import contextmanager


class ForcegraspError(Exception):
    """Base of every error that is shown to the user as one line, without a traceback."""


class ConfigError(ForcegraspError):
    """An option is unknown, of the wrong type, or out of its range."""


class MeasurementError(ForcegraspError):
    """A measurement set is missing, unreadable, or can't be right: names the file, and row and column where it can."""


class PhysicsError(ForcegraspError):
    """A simulated grasp diverged."""


class CheckpointError(ForcegraspError):
    """A run directory or checkpoint is missing, broken, or of another configuration."""


class DeployError(ForcegraspError):
    """An exported policy is missing, damaged or can't be run here, or a controller has nothing to hold."""


@contextmanager
def writing(out: object) -> Generator[None]:
    """Raises ConfigError about ``out=`` if what is written meanwhile can't be."""
    try:
        yield
    except OSError as error:
        raise ConfigError(f"out={out}: could not write ({error.strerror})") from error


def closest(name: str, known: Iterable[str], lists_them: str = "") -> str:
    """Returns ``"; did you mean a, b or c?"`` for the (at most three) closest known names, or the list of all.

    Args:
      name: that nobody knows.
      known: the names that there are.
      lists_them: a command that lists them, for a list that is too long for one line.
    """
    known = sorted(known)
    near = difflib.get_close_matches(name, known, n=3, cutoff=0.5)
    if near:
        return f"; did you mean {' or '.join(near)}?"
    return f"; {lists_them} lists them" if lists_them else f"; known: {', '.join(known)}"
