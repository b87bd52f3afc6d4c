"""Tells quantisation by counting: readings that are all multiples of one step."""

from __future__ import annotations

import numpy as np

# Values may miss their multiple by this share of a step, and so many of them may miss it by more.
_LOOSE, _MISSES = 0.03, 0.005
# With fewer distinct values than this, or more than this share of all, counting says nothing.
_LEAST_VALUES, _MOST_DISTINCT = 4, 0.6


def find_step(readings: np.ndarray) -> float:
    """Step of a quantised signal, in its unit; 0 if it is not quantised.

    Args:
      readings: of one signal, any shape.
    """
    values = np.sort(np.asarray(readings, float).ravel())
    span = values[-1] - values[0] if len(values) else 0.0
    if span <= 0:
        return 0.0
    distinct = values[np.r_[True, np.diff(values) > 1e-6 * span]]
    if not _LEAST_VALUES <= len(distinct) <= _MOST_DISTINCT * len(values):
        return 0.0
    step = float(np.min(np.diff(distinct)))
    for _ in range(3):  # the smallest gap is a guess; all distances together fix it
        count = np.round((distinct - distinct[0]) / step)
        step = float(count @ (distinct - distinct[0]) / (count @ count))
    off = np.abs((distinct - distinct[0]) / step - np.round((distinct - distinct[0]) / step))
    return step if np.mean(off > _LOOSE) <= _MISSES else 0.0
