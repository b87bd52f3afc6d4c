"""Readings that are the one before, to the last bit: what a log keeps where a sensor's message did not arrive."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from forcegrasp.measure.check_copies import is_noisy
from forcegrasp.measure.samples import place
from forcegrasp.measure.schema import MeasurementSet

# So few may agree by chance, as rows and as a share of them; and so many times those that agree with the last but one.
_LEAST, _LEAST_SHARE, _TIMES = 5, 0.005, 3


def check_repeats(measured: MeasurementSet) -> list[str]:
    """Returns a warning for each sensor whose noisy readings are at times the one before."""
    warnings = []
    for name in (*measured.columns.position, *measured.columns.force):
        signals = [grasp.signals()[name] for grasp in measured.grasps]
        repeats = _repeats(signals, 1)
        count, rows = sum(int(one.sum()) for one in repeats), sum(len(one) for one in repeats)
        # of readings that are rounded as many agree by chance with the last but one, and no held one does
        by_chance = sum(int(one.sum()) for one in _repeats(signals, 2))
        if count < max(_LEAST, _LEAST_SHARE * rows, _TIMES * by_chance) or not is_noisy(signals):
            continue
        first = next(i for i, one in enumerate(repeats) if one.any())
        where = place(measured.path, measured.grasps[first], int(repeats[first].argmax()), name)
        warnings.append(
            f"{where}: the reading before once more, to the last bit, as in {count / rows:.1%} of all rows, which a"
            " sensor with noise does not give: did messages not arrive, and was the last one kept?"
        )
    return warnings


def _repeats(signals: Sequence[np.ndarray], lag: int) -> list[np.ndarray]:
    """Which readings are one before, and none between, each ``(T,)``; but for values that come back: sensors rest at 0.

    Args:
      signals: of a sensor, each ``(T,)``.
      lag: 1 for the one before, 2 for the last but one.
    """
    same = [np.r_[False, signal[1:] == signal[:-1]] for signal in signals]
    begins = np.concatenate([signal[~again] for signal, again in zip(signals, same, strict=True)])
    values, counts = np.unique(begins, return_counts=True)
    rare = values[counts == lag]
    if lag > 1:
        same = [
            np.r_[False, False, (s[2:] == s[:-2]) & ~again[2:] & ~again[1:-1]]
            for s, again in zip(signals, same, strict=True)
        ]
    return [again & np.isin(signal, rare) for signal, again in zip(signals, same, strict=True)]
