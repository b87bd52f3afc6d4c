"""Indices as slices, which numpy reads and writes faster."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


def places(indices: Sequence[int] | np.ndarray) -> slice | np.ndarray:
    """These indices, in this order: as a slice if they are evenly spaced."""
    steps = set(np.diff(indices).tolist())
    if len(steps) > 1 or 0 in steps or not len(indices):
        return np.array(indices, int)
    step = int(next(iter(steps), 1))
    end = int(indices[-1]) + (1 if step > 0 else -1)
    return slice(int(indices[0]), None if end < 0 else end, step)
