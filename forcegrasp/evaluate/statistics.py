"""What can be said about a metric from a number of trials: means, quantiles, and how sure they are.

Intervals are 95 % percentile bootstrap intervals, stratified: trials are drawn anew within each cell (a softness value,
an object), never across cells (Agarwal et al. 2021, *Deep RL at the edge of the statistical precipice*).
"""

from __future__ import annotations

import numpy as np
from scipy.stats import trim_mean

RESAMPLES = 1000
#: Quantiles that are told beside the mean, by name.
QUANTILES = {"median": 0.5, "p95": 0.95}


class Bootstrap:
    """The same resamples for every metric and policy, which also makes all of it repeatable.

    Args:
      cells: number of strata.
      trials: trials in each.
      seed: of the resampling.
    """

    def __init__(self, cells: int, trials: int, seed: int) -> None:
        rng = np.random.default_rng(seed)
        self.picks = rng.integers(trials, size=(RESAMPLES, cells, trials), dtype=np.int32)

    def describe(self, values: np.ndarray) -> dict:
        """Mean, standard deviation, interquartile mean, median and 95th percentile with intervals, over all cells; and
        in each cell all but the interquartile mean, the quantiles without intervals.

        Args:
          values: ``(cells, trials)``.
        """
        drawn = np.take_along_axis(values[None], self.picks, axis=2)
        everything = np.sort(drawn.reshape(len(drawn), -1), axis=1)
        iqm_low, iqm_high = _interval(_interquartile_mean(everything))
        cells = [
            {"mean": float(row.mean()), "std": float(row.std(ddof=1)), "low": low, "high": high} | _quantiles(row)
            for row, (low, high) in zip(values, map(_interval, drawn.mean(2).T), strict=True)
        ]
        low, high = _interval(everything.mean(1))
        ends = {
            f"{name}_{end}": bound
            for name, share in QUANTILES.items()
            for end, bound in zip(("low", "high"), _interval(_quantile(everything, share)), strict=True)
        }
        return {
            "mean": float(values.mean()),
            "std": float(values.std(ddof=1)),
            "low": low,
            "high": high,
            "iqm": float(trim_mean(values.ravel(), 0.25)),
            "iqm_low": iqm_low,
            "iqm_high": iqm_high,
            **_quantiles(values.ravel()),
            **ends,
            "by_cell": cells,
        }

    def improvement(self, values: np.ndarray, baseline: np.ndarray) -> dict[str, float]:
        """Probability that a trial has a larger value than one of the baseline in the same cell; ties count half.

        Args:
          values, baseline: ``(cells, trials)``.
        """
        cells, trials = values.shape
        one, other = (self._counts(self.picks), self._counts(self.picks[::-1]))
        drawn, plain = np.zeros(len(one)), 0.0
        for cell in range(cells):
            difference = np.sign(values[cell][:, None] - baseline[cell][None, :])
            better = (difference + 1) / 2
            plain += better.mean() / cells
            drawn += ((one[:, cell] @ better) * other[:, cell]).sum(1) / trials**2 / cells
        low, high = _interval(drawn)
        return {"probability": float(plain), "low": low, "high": high}

    @staticmethod
    def _counts(picks: np.ndarray) -> np.ndarray:
        """How often each trial was drawn, ``(resamples, cells, trials)``."""
        resamples, cells, trials = picks.shape
        row = np.arange(resamples * cells)[:, None] * trials
        counts = np.bincount((row + picks.reshape(-1, trials)).reshape(-1), minlength=picks.size)
        return counts.reshape(picks.shape).astype(float)


def _interquartile_mean(rows: np.ndarray) -> np.ndarray:
    """Mean of the middle half of each sorted row, ``(n, m) -> (n,)``."""
    cut = rows.shape[1] // 4
    return rows[:, cut : rows.shape[1] - cut].mean(1)


def _quantile(rows: np.ndarray, share: float) -> np.ndarray:
    """Quantile of each sorted row, interpolated between its neighbours, ``(n, m) -> (n,)``."""
    below, part = divmod(share * (rows.shape[1] - 1), 1)
    above = min(int(below) + 1, rows.shape[1] - 1)
    return (1 - part) * rows[:, int(below)] + part * rows[:, above]


def _quantiles(values: np.ndarray) -> dict[str, float]:
    return {name: float(np.quantile(values, share)) for name, share in QUANTILES.items()}


def _interval(drawn: np.ndarray) -> tuple[float, float]:
    low, high = np.quantile(drawn, (0.025, 0.975))
    return float(low), float(high)
