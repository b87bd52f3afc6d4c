"""Ends a search early, with what was found by then."""

from __future__ import annotations

from forcegrasp.identify.progress import Progress
from forcegrasp.replay.time_limit import OutOfTimeError, lift_time_limit

#: What ends one: Ctrl-C, or the end of the time that it may take.
REASONS = (KeyboardInterrupt, OutOfTimeError)
#: Says that a person, or a scheduler, ended it.
INTERRUPTED = "it was interrupted"


def cut_short(reason: BaseException, progress: Progress) -> str:
    """Why a search ended early, in words; what there is still to do may take its time."""
    lift_time_limit()
    words = reason.words if isinstance(reason, OutOfTimeError) else INTERRUPTED
    progress(f"stopping, for {words}: what was found so far is worked out")
    return words
