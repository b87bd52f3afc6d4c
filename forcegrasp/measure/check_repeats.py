"""Readings that are the one before, to the last bit: what a log keeps where a sensor's message did not arrive."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from forcegrasp.measure.check_copies import is_noisy
from forcegrasp.measure.samples import place
from forcegrasp.measure.schema import MeasurementSet

# So few may agree by chance, as rows and as a share of them.
_LEAST, _LEAST_SHARE = 5, 0.005


def check_repeats(measured: MeasurementSet) -> list[str]:
    """Returns a warning for each sensor whose noisy readings are at times the one before."""
    warnings = []
    for name in (*measured.columns.position, *measured.columns.force):
        signals = [grasp.signals()[name] for grasp in measured.grasps]
        repeats = _repeats(signals)
        count, rows = sum(int(one.sum()) for one in repeats), sum(len(one) for one in repeats)
        if count < _LEAST or count < _LEAST_SHARE * rows or not is_noisy(signals):
            continue
        first = next(i for i, one in enumerate(repeats) if one.any())
        where = place(measured.path, measured.grasps[first], int(repeats[first].argmax()), name)
        warnings.append(
            f"{where}: the reading before once more, to the last bit, as in {count / rows:.1%} of all rows, which a"
            " sensor with noise does not give: did messages not arrive, and was the last one kept?"
        )
    return warnings


def _repeats(signals: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Which readings are the one before, each ``(T,)``, but for values that come back: sensors round, and rest at 0."""
    same = [np.r_[False, signal[1:] == signal[:-1]] for signal in signals]
    begins = np.concatenate([signal[~again] for signal, again in zip(signals, same, strict=True)])
    values, counts = np.unique(begins, return_counts=True)
    once = values[counts == 1]
    return [again & np.isin(signal, once) for signal, again in zip(signals, same, strict=True)]
