"""What one unit of a position is in radians, by the counts of the encoder that it was read from."""

from __future__ import annotations

import numpy as np

#: Counts of a turn of Feetech's STS3215 and Dynamixel's X series, whose encoders are on the output shaft.
COUNTS = 4096
# Fewer different steps tell nothing, nor do steps of which more than a few are no multiples of one count; the least of
# a short recording may be some counts wide.
_LEAST_STEPS, _WHOLE, _OFF, _COUNTS_OF_LEAST = 4, 0.95, 0.1, range(1, 6)


def radians_per_unit(position: np.ndarray) -> float | None:
    """Radians of one unit of readings ``(T,)`` that are counts of 1/4096 of a turn; None if they are no counts."""
    values = np.unique(np.round(position[np.isfinite(position)], 9))
    steps = np.diff(values)
    steps = steps[steps > 1e-5 * np.abs(values).max(initial=0)]  # less is rounding
    if len(steps) < _LEAST_STEPS:
        return None
    least = float(np.median(steps[steps < 1.5 * steps.min()]))
    for step in (least / wide for wide in _COUNTS_OF_LEAST):
        if np.mean(np.abs(steps / step - np.round(steps / step)) < _OFF) >= _WHOLE:
            return 2 * np.pi / COUNTS / step
    return None
