"""Forces that a level limits, at once or bending towards it before."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Parameter

#: How early forces bend: not at all below the level at 0, as tanh would at 0.4, to half of it there at 1.
KNEE = Parameter("knee", "how early it bends k", "1", 0.0, 1.0, 0.1, null=0.1)


def bent(force: np.ndarray, level: np.ndarray, knee: np.ndarray) -> np.ndarray:
    """f / (1 + |f / F|^(1/k))^k, which is clip(f, −F, F) at k = 0: the two asymptotes of Churchill and Usagi (1972).

    Args:
      force: newtons, ``(rows, width)``.
      level: F, newtons, ``(rows, 1)``; none where it is infinite.
      knee: k, ``(rows, 1)``.
    """
    clipped = np.clip(force, -level, level)
    bends = (knee > 0) & np.isfinite(level)
    if not bends.any():
        return clipped
    power = 1 / np.where(bends, knee, 1.0)
    with np.errstate(divide="ignore"):  # no force at all; by logarithms, as powers grow beyond all numbers
        lower = np.exp(-np.logaddexp(-power * np.log(np.abs(force)), -power * np.log(level)) / power)
    return np.where(bends, np.sign(force) * lower, clipped)
