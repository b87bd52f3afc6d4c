"""Values and slopes of a prediction near a point, with as few simulations as will do."""

from __future__ import annotations

import numpy as np

from forcegrasp.identify.predict import predict
from forcegrasp.identify.problem import Problem
from forcegrasp.identify.target import Target
from forcegrasp.replay.replay import Replay

# Slopes are measured anew after so many steps; in between they follow the values (Broyden 1965), if they are few: of
# all grasps, or else of each one, by what it depends on.
_SLOPES_LAST, _FEW = 3, 30


class LocalSlopes:
    """Values and slopes of a prediction, with as few simulations as will do.

    Args:
      target: the measurements.
      problem: what may be changed.
      values: simulates the values.
      slopes: simulates the slopes.
      known: slopes of the first coordinates, which are not to be found again, ``(G, S, C, k)``.
      step: of the finite differences, in coordinates.
    """

    def __init__(
        self, target: Target, problem: Problem, values: Replay, slopes: Replay, known: np.ndarray | None, step: float
    ) -> None:
        self.target, self.problem = target, problem
        self._values, self._slopes, self._known, self._step = values, slopes, known, step
        self._value: tuple[np.ndarray, np.ndarray] | None = None  # the last point, and the signals there
        self._slope: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None  # point, signals, slopes
        self._age = 0

    def value(self, x: np.ndarray) -> np.ndarray:
        """Predicted signals, ``(G, S, C)``."""
        if self._value is None or not np.array_equal(self._value[0], x):
            self._value = (x.copy(), predict(self._values, [self.problem.case(x)])[0])
        return self._value[1]

    def recall(self, x: np.ndarray, signals: np.ndarray) -> None:
        """Takes signals that were predicted at a point before."""
        self._value = (x.copy(), signals)

    def has_measured(self, x: np.ndarray) -> bool:
        """Whether the slopes at hand were measured at this point."""
        return self._slope is not None and self._age == 0 and np.array_equal(self._slope[0], x)

    def begin(self, x: np.ndarray, slopes: np.ndarray) -> None:
        """Takes slopes of the first coordinates for those at a point; the others are measured."""
        value = self.value(x)
        if slopes.shape[-1] < len(x):
            slopes = self._measured(x, value, slopes)
        self._slope, self._age = (x.copy(), value, slopes), 1

    def latest(self, x: np.ndarray) -> np.ndarray:
        """The slopes that are at hand, ``(G, S, C, p)``; measured if there are none."""
        return self.slopes(x) if self._slope is None else self._slope[2]

    def slopes(self, x: np.ndarray, anew: bool = False) -> np.ndarray:
        """Slopes of the signals ÷ noise over the coordinates, ``(G, S, C, p)``."""
        value = self.value(x)
        if self._slope is not None and np.array_equal(self._slope[0], x) and not (anew and self._age):
            return self._slope[2]
        many = self.problem.concerned.sum(axis=1).max(initial=0) > _FEW
        if self._slope is None or anew or self._age >= _SLOPES_LAST or many:
            self._age, slopes = 0, self._measured(x, value, self._known)
        else:
            self._age += 1
            before, signals, slopes = self._slope
            step = x - before
            surprise = self.target.change(value, signals) - slopes @ step
            own = np.where(self.problem.concerned, step, 0.0) if len(x) > _FEW else np.tile(step, (len(value), 1))
            own /= np.maximum(np.sum(own**2, axis=1, keepdims=True), 1e-300)
            slopes = slopes + surprise[..., None] * own[:, None, None]
        self._slope = (x.copy(), value, slopes)
        return slopes

    def _measured(self, x: np.ndarray, value: np.ndarray, known: np.ndarray | None) -> np.ndarray:
        """One-sided differences, all in one simulation; 0 where a coordinate jumps, and no slope leads anywhere."""
        problem, target = self.problem, self.target
        count = 0 if known is None else known.shape[-1]
        groups = [g for g in problem.columns() if min(g) >= count and not problem.entries[g[0]].jumps]
        width = problem.high - problem.low
        step = np.where(x + self._step > problem.high, -self._step, self._step)
        step = np.where(width < 2 * self._step, width / 4, step)
        moved = [x + step * np.isin(np.arange(len(x)), group) for group in groups]
        same = self._values is self._slopes or not moved
        asked = [problem.case(v) for v in (moved if same else [x, *moved])]
        signals = predict(self._slopes, asked) if asked else np.empty((0, *value.shape))
        signals, base = (signals, value) if same else (signals[1:], signals[0])
        slopes = np.zeros((*value.shape, len(problem)))
        for change, group in zip(signals - base, groups, strict=True):
            for index in group:
                members = problem.entries[index].members
                slopes[members, :, :, index] = change[members] / step[index]
        slopes /= target.sigma[:, None]
        slopes[~target.mask] = 0
        if known is not None:
            slopes[..., :count] = known
        return slopes
