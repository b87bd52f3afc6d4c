"""What estimates of one quantity from several sets have in common, and how far they spread beyond their own errors."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from scipy.optimize import brentq
from scipy.stats import chi2, t

from forcegrasp.identify.intervals import Z95


def holm(p: Sequence[float]) -> np.ndarray:
    """Probabilities corrected for their number, ``(n,)`` (Holm 1979, Scand. J. Statist. 6)."""
    order = np.argsort(p)
    raised = np.maximum.accumulate(np.asarray(p)[order] * np.arange(len(p), 0, -1))
    return np.minimum(raised, 1.0)[np.argsort(order)]


def p_alike(values: np.ndarray, errors: np.ndarray) -> float:
    """Probability of estimates this far apart if all are of one value: Cochran's Q, for two of them a Wald test.

    Args:
      values: the estimates, ``(k,)``.
      errors: their standard errors, ``(k,)``.
    """
    return float(chi2.sf(_heterogeneity(values, errors, 0.0), len(values) - 1))


def shared_value(
    values: np.ndarray, errors: np.ndarray, spread: float | None = None, common: float = 0.0
) -> tuple[float, float, float]:
    """The mean of all, weighted by their errors, and its 95 % interval.

    With a spread it is that of all sets that could have been recorded, and so is the interval, by Student's t as the
    spread is known from few (Hartung and Knapp 2001, Statist. Med. 20).

    Args:
      values: the estimates, ``(k,)``.
      errors: their standard errors, ``(k,)``.
      spread: from :func:`spread_between`; None takes all for one value.
      common: standard error that all have alike, and no mean takes out.
    """
    weight = 1 / (errors**2 + (spread or 0.0) ** 2)
    mean = float(np.sum(weight * values) / np.sum(weight))
    own = (Z95 if spread is None else t.ppf(0.975, len(values) - 1)) / np.sqrt(np.sum(weight))
    half = float(np.hypot(own, Z95 * common))
    return mean, mean - half, mean + half


def spread_between(values: np.ndarray, errors: np.ndarray) -> tuple[float, float, float]:
    """Standard deviation between sets, and its 95 % interval.

    Of Paule and Mandel (1982, J. Res. Natl. Bur. Stand. 87), with the interval of the same statistic (the Q-profile of
    Viechtbauer 2007, Statist. Med. 26).

    Args:
      values: the estimates, ``(k,)``, three at least.
      errors: their standard errors, ``(k,)``.
    """
    freedom = len(values) - 1
    at_least, at_most = chi2.ppf((0.975, 0.025), freedom)

    def left(spread: float) -> float:
        return _heterogeneity(values, errors, spread)

    def left_or_chance(spread: float) -> float:
        """Sets that agree better than chance lets them don't prove that there is no spread."""
        return max(left(spread), freedom * float(np.mean(errors**2 / (errors**2 + spread**2))))

    return _root(left, freedom), _root(left, at_least), _root(left_or_chance, at_most)


def _heterogeneity(values: np.ndarray, errors: np.ndarray, spread: float) -> float:
    """Weighted squares about the mean; falls as the spread grows."""
    weight = 1 / (errors**2 + spread**2)
    return float(np.sum(weight * (values - np.sum(weight * values) / np.sum(weight)) ** 2))


def _root(falling: Callable[[float], float], wanted: float) -> float:
    """Where a falling function has a value; 0 if it starts below."""
    if falling(0.0) <= wanted:
        return 0.0
    high = 1.0
    while falling(high) > wanted:
        high *= 2
    return float(brentq(lambda x: falling(x) - wanted, 0.0, high, xtol=1e-12))  # pyright: ignore[reportArgumentType]
