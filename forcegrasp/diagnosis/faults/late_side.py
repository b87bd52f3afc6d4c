"""Which of two motors follows its command a row late while the other does not: no effect makes one side late alone."""

from __future__ import annotations

import numpy as np

from forcegrasp.diagnosis.faults.shifted_rows import WORTH_A_FIT, left_by_shift
from forcegrasp.diagnosis.signatures import Background
from forcegrasp.identify.fit import Fit
from forcegrasp.identify.target import Target


def late_side(target: Target, fit: Fit) -> int | None:
    """The side whose readings fit what was simulated one row before, if those of the other side do not; else None.

    Args:
      target: the measurements.
      fit: of the base model.
    """
    sides, motors = target.axis.sides, target.axis.positions.stop
    if motors < 2 or len({channel for side in sides for channel in side}) < sum(map(len, sides)):
        return None  # a motor for both sides, or a reading
    background = Background(fit, ())

    def left(channels: list[int]) -> float:
        """What is beyond the noise once these readings are taken as one row earlier."""
        return max(0.0, left_by_shift(target, fit, background, channels, later=False))

    of_sides, of_all = [left(side) for side in sides], left([channel for side in sides for channel in side])
    best = int(np.argmin(of_sides))
    return best if of_sides[best] < (1 - WORTH_A_FIT) * min(left([]), of_all) else None


def command_row_later(command_m: np.ndarray, side: int) -> np.ndarray:
    """Commands ``(T, motors)`` with those of one side one row later; the first one stays."""
    moved = command_m.copy()
    moved[1:, side] = command_m[:-1, side]
    return moved
