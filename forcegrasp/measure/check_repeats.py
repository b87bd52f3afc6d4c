"""Readings that are the one before, to the last bit: what a log keeps where a sensor's message did not arrive."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from forcegrasp.measure.check_copies import is_noisy
from forcegrasp.measure.rounding import find_step
from forcegrasp.measure.samples import place
from forcegrasp.measure.schema import MeasurementSet

# Readings that are rounded to steps of more than this share of what they scatter by agree by chance too often.
_COARSE = 0.1
# So few may agree by chance, as rows and as a share of them; and so many times what rounding alone makes agree.
_LEAST, _LEAST_SHARE, _TIMES = 5, 0.005, 3


def check_repeats(measured: MeasurementSet) -> list[str]:
    """Returns a warning for each sensor whose noisy readings are at times the one before."""
    warnings = []
    for name in (*measured.columns.position, *measured.columns.force):
        signals = [grasp.signals()[name] for grasp in measured.grasps]
        repeats, returns = _repeats(signals)
        by_chance = max(returns, _by_rounding(signals))
        count, rows = sum(int(one.sum()) for one in repeats), sum(len(one) for one in repeats)
        few = count < max(_LEAST, _LEAST_SHARE * rows, _TIMES * by_chance)
        if few or not is_noisy(signals) or _is_coarse(signals):
            continue
        first = next(i for i, one in enumerate(repeats) if one.any())
        where = place(measured.path, measured.grasps[first], int(repeats[first].argmax()), name)
        warnings.append(
            f"{where}: the reading before once more, to the last bit, as in {count / rows:.1%} of all rows, which a"
            " sensor with noise does not give: did messages not arrive, and was the last one kept?"
        )
    return warnings


def _is_coarse(signals: Sequence[np.ndarray]) -> bool:
    """Whether a sensor's steps are no smaller than its noise, by the changes between its readings."""
    changes = np.abs(np.concatenate([np.diff(signal) for signal in signals]))
    return find_step(np.concatenate(signals)) > _COARSE * float(np.median(changes))


def _by_rounding(signals: Sequence[np.ndarray]) -> float:
    """How many readings are the one before by chance: those that nearly are, by how fine they are written.

    So few that they come and go from sensor to sensor, where readings are written ten times as fine as they scatter.
    """
    changes = np.abs(np.concatenate([np.diff(signal) for signal in signals]))
    near, changed = _COARSE * float(np.median(changes)), changes[changes > 0]
    if not changed.size or not near:
        return 0.0
    return float(np.sum(changed <= near) * changed.min() / (2 * near))


def _repeats(signals: Sequence[np.ndarray]) -> tuple[list[np.ndarray], int]:
    """Which readings are the one before, each ``(T,)``, and how many are the last but one, and not the one between.

    But for values that come back besides: sensors round, and rest at 0. Of readings that are rounded as many agree by
    chance with the last but one as with the one before, and no held one does.
    """
    same = [np.r_[False, signal[1:] == signal[:-1]] for signal in signals]
    begins = np.concatenate([signal[~again] for signal, again in zip(signals, same, strict=True)])
    values, counts = np.unique(begins, return_counts=True)
    once, twice = (values[counts == times] for times in (1, 2))
    pairs = list(zip(signals, same, strict=True))
    returns = [(s[2:] == s[:-2]) & ~again[2:] & ~again[1:-1] & np.isin(s[2:], twice) for s, again in pairs]
    return [again & np.isin(signal, once) for signal, again in pairs], sum(int(one.sum()) for one in returns)
