"""White noise of readings, from their third differences: those of a smooth signal vanish."""

from __future__ import annotations

from typing import Any

import numpy as np


def white_noise(third: np.ndarray, axis: int | None = None) -> Any:
    """Standard deviation of white noise with third differences like these, whose variance is 20 σ²; by their median.

    Args:
      third: third differences, at least one.
      axis: along which they are of one signal; by default all are.
    """
    return 1.4826 * np.median(np.abs(third), axis=axis) / np.sqrt(20)
