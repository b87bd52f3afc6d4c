"""Fits parameters to measured grasps by bounded least squares, residuals divided by the sensor noise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from forcegrasp.compare.predict import predict
from forcegrasp.compare.problem import Problem
from forcegrasp.compare.target import Target
from forcegrasp.measure.replay import Replay

# Step of the finite differences in a problem's coordinates: far above the chaos of the contacts, within the bend.
_STEP = 0.02
# Relative change of the cost at which a fit ends, and the largest number of simulations until then.
_TOLERANCE, _EVALUATIONS = 1e-4, 15


class Simulators:
    """The replays that a fit needs: the model itself, and a cheap one where the gripper has a fast tier.

    Slopes come from the cheap one, and values too, corrected by the difference of the two at a nearby point; so few
    evaluations of the model itself are needed, and what is fitted in the end is the model itself.
    """

    def __init__(self, problem: Problem) -> None:
        gripper, grasps = problem.gripper, problem.grasps
        self.exact = Replay(gripper, grasps)
        self.cheap = self.exact if gripper.fast == "none" else Replay(gripper, grasps, tier="fast")


@dataclass(frozen=True)
class Fit:
    """Fitted parameters with all that an evidence needs. N residuals (G · S · 4), p entries."""

    problem: Problem
    vector: np.ndarray  #: the problem's coordinates, ``(p,)``
    predicted: np.ndarray  #: signals, ``(G, S, 4)``
    residual: np.ndarray  #: (measured − predicted) ÷ noise, ``(G, S, 4)``
    jacobian: np.ndarray  #: d predicted ÷ noise over coordinates, ``(G, S, 4, p)``
    correction: np.ndarray  #: exact minus cheap prediction, ``(G, S, 4)``
    gradient: float  #: largest |slope| of the cost along one coordinate, in its own standard error; 0 at an optimum
    evaluations: int

    @property
    def cost(self) -> float:
        """Sum of squared residuals, in units of the noise."""
        return float(np.sum(self.residual**2))

    @property
    def values(self) -> np.ndarray:
        """Parameters in their own units, ``(p,)``."""
        return self.problem.values(self.vector)

    def covariance(self) -> np.ndarray:
        """Covariance of the coordinates, ``(p, p)``, if the noise is white; see :mod:`forcegrasp.compare.intervals`."""
        flat = self.jacobian.reshape(-1, len(self.problem))
        return np.linalg.pinv(flat.T @ flat, rcond=1e-12)


def fit_once(
    target: Target,
    problem: Problem,
    simulators: Simulators,
    start: np.ndarray,
    correction: np.ndarray | None = None,
    rounds: int = 2,
    free: np.ndarray | None = None,
    known_slopes: np.ndarray | None = None,
) -> Fit:
    """Fits from one start.

    Args:
      target: the measurements.
      problem: what may be changed.
      simulators: of the problem's grasps.
      start: coordinates to start from, ``(p,)``.
      correction: exact minus cheap prediction near the start; found there if not given.
      rounds: how often the correction is renewed; with 0 it stays as given.
      free: which coordinates may change, ``(p,)``; all by default.
      known_slopes: of the first k coordinates from an earlier fit nearby, ``(G, S, 4, k)``; they are kept, which spares
        most of the simulations.
    """
    cheap = _Remembered(lambda x: _with_slopes(problem, simulators.cheap, target, x, known_slopes))
    inside = np.clip(start, problem.low + 1e-9, problem.high - 1e-9)
    free = np.ones(len(problem), bool) if free is None else free
    exact_is_cheap = simulators.exact is simulators.cheap
    if correction is None:
        correction = 0.0 if exact_is_cheap else _difference(problem, simulators, inside)
    total = 0
    for turn in range(max(1, rounds) if free.any() else 0):

        def whole(part: np.ndarray, known=inside) -> np.ndarray:
            vector = known.copy()
            vector[free] = part
            return vector

        def residuals(part: np.ndarray, whole=whole, shift=correction) -> np.ndarray:
            return -target.residual(cheap(whole(part))[0] + shift).ravel()

        solution = least_squares(
            residuals,
            inside[free],
            jac=lambda part, whole=whole: cheap(whole(part))[1].reshape(-1, len(problem))[:, free],
            bounds=(problem.low[free], problem.high[free]),
            x_scale="jac",
            ftol=_TOLERANCE,
            xtol=1e-6,
            gtol=1e-10,
            max_nfev=_EVALUATIONS,
        )
        inside, total = whole(solution.x), total + solution.nfev
        if exact_is_cheap or rounds == 0:
            break
        renewed = _difference(problem, simulators, inside)
        change = np.sqrt(np.mean(((renewed - correction) / target.sigma)[target.mask] ** 2))
        correction = renewed
        if change < 0.02 and turn:
            break
    predicted, jacobian = cheap(inside)
    predicted = predicted + correction
    residual = target.residual(predicted)
    flat = jacobian.reshape(-1, len(problem))
    norms = np.maximum(np.linalg.norm(flat, axis=0), 1e-12)
    slope = flat.T @ residual.ravel() / norms
    blocked = ~free | ((inside <= problem.low + 1e-6) & (slope < 0)) | ((inside >= problem.high - 1e-6) & (slope > 0))
    correction = np.broadcast_to(correction, predicted.shape)
    return Fit(
        problem, inside, predicted, residual, jacobian, correction, float(np.abs(slope[~blocked]).max(initial=0)), total
    )


def _difference(problem: Problem, simulators: Simulators, vector: np.ndarray) -> np.ndarray:
    case = [problem.case(vector)]
    return predict(simulators.exact, case)[0] - predict(simulators.cheap, case)[0]


def _with_slopes(
    problem: Problem, replay: Replay, target: Target, vector: np.ndarray, known: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray]:
    """Prediction ``(G, S, 4)`` and its slopes ÷ noise ``(G, S, 4, p)`` by one-sided differences, in one simulation."""
    count = 0 if known is None else known.shape[-1]
    groups = [group for group in problem.columns() if min(group) >= count]
    step = np.where(vector + _STEP > problem.high, -_STEP, _STEP)
    step = np.where(np.abs(problem.high - problem.low) < 2 * _STEP, (problem.high - problem.low) / 4, step)
    varied = [vector]
    for group in groups:
        moved = vector.copy()
        moved[group] += step[group]
        varied.append(moved)
    signals = predict(replay, [problem.case(v) for v in varied])
    slopes = np.zeros((*signals.shape[1:], len(problem)))
    for change, group in zip(signals[1:] - signals[0], groups, strict=True):
        for index in group:
            members = problem.entries[index].members
            slopes[members, :, :, index] = change[members] / step[index]
    slopes /= target.sigma[:, None]
    slopes[~target.mask] = 0
    if count:
        slopes[..., :count] = known
    return signals[0], slopes


class _Remembered:
    """Keeps the last result: the optimiser asks for value and slopes of the same point one after the other."""

    def __init__(self, function: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]) -> None:
        self._function, self._last = function, (None, None)

    def __call__(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        if self._last[0] is None or not np.array_equal(self._last[0], x):
            self._last = (x.copy(), self._function(x))
        return self._last[1]
