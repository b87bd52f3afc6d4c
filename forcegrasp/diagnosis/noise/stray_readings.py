"""Single readings that are far off, here and there: noise of a bus or a sensor, which no missing effect makes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.stats import chisquare

# A reading this many σ off is stray if both its neighbours are no further off than this.
_FAR, _NEAR = 4.0, 3.0
# They are everywhere alike unless chance alone gives counts as uneven as theirs with less than this probability.
_UNEVEN = 0.01


def stray_readings(residual: np.ndarray, partitions: Sequence[Sequence[np.ndarray]]) -> np.ndarray:
    """Which readings are stray, ``(G, S, C)``; none if they are more frequent in some grasps, phases or states.

    What a model lacks is left where it acts: a contact that comes a sample late is a spike, too, but at contact.

    Args:
      residual: in units of the noise, ``(G, S, C)``; NaN where there is none.
      partitions: of each signal's samples into groups, each ``(G, S)``, −1 where a sample is in none.
    """
    size = np.nan_to_num(np.abs(residual))
    quiet = np.pad(size < _NEAR, ((0, 0), (1, 1), (0, 0)), constant_values=True)
    stray = (size > _FAR) & quiet[:, :-2] & quiet[:, 2:]
    there = np.isfinite(residual)
    of_grasps = np.broadcast_to(np.arange(len(residual))[:, None], residual.shape[:2])
    for groups in zip(*([*one, of_grasps] for one in partitions), strict=True):
        if not _is_even(stray, there, groups):
            return np.zeros_like(stray)
    return stray


def without_spikes(residual: np.ndarray) -> np.ndarray:
    """Residuals ``(G, S, C)`` of which none is further off than 4 σ, or than the neighbour that is further off.

    What a model misses lasts; of noise with heavy tails one reading may outweigh its whole grasp.
    """
    size = np.pad(np.abs(residual), ((0, 0), (1, 1), (0, 0)))
    most = np.maximum(_FAR, np.maximum(size[:, :-2], size[:, 2:]))
    return np.clip(residual, -most, most)


def _is_even(stray: np.ndarray, there: np.ndarray, groups: Sequence[np.ndarray]) -> bool:
    """Whether stray readings are as frequent in each group of samples; of all signals, each with groups of its own."""
    count = 1 + max(int(group.max()) for group in groups)
    found, samples = np.zeros(count), np.zeros(count)
    for channel, group in enumerate(groups):
        inside = there[..., channel] & (group >= 0)
        samples += np.bincount(group[inside], minlength=count)
        found += np.bincount(group[inside], weights=stray[..., channel][inside], minlength=count)
    known = samples > 0
    if found.sum() == 0 or known.sum() < 2:
        return True
    expected = samples[known] / samples.sum() * found.sum()
    return bool(chisquare(found[known], expected).pvalue > _UNEVEN)
