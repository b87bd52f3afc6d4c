"""A fit that a few grasps lead astray: the others are fitted without them, and all of them from there."""

from __future__ import annotations

import numpy as np

from forcegrasp.identify.fit import Fit, Simulators, fit_exactly
from forcegrasp.identify.predict import predict
from forcegrasp.identify.target import Target

# Few are this share of the grasps at most, or one; they hold most of what a fit leaves if they hold this share of it.
_FEW, _MOST = 1 / 8, 0.6


def fit_past_few(fit: Fit, target: Target, simulators: Simulators) -> Fit:
    """The better of a fit and one that begins where the others lead, if few grasps hold most of what the fit leaves.

    A finger that is a little late meets an object that the other one has pushed, or does not: at such a place the error
    of a grasp jumps, and no slope leads across. The other grasps know the way.

    Args:
      fit: a fit of all grasps.
      target: the measurements.
      simulators: of the problem's grasps.
    """
    others = _others(fit, target)
    if not len(others):
        return fit
    part = fit.subset(others)
    of_others = Simulators(part.problem, exact=simulators.one_model)
    alone = fit_exactly(target.subset(others), part.problem, of_others, part.vector)
    start = fit.moved(part.problem, alone.vector)
    residual = target.residual(predict(simulators.exact, [fit.problem.case(start)])[0])
    if np.sum((fit.weight * residual) ** 2) >= fit.cost:
        return fit
    again = fit_exactly(target, fit.problem, simulators, start)
    return min([fit, again], key=lambda one: one.cost)


def _others(fit: Fit, target: Target) -> np.ndarray:
    """Indices of the grasps without the few that hold most of what is beyond the noise; none if none do."""
    squares = np.sum((fit.weight * fit.residual) ** 2 - (fit.weight * target.mask[..., None]) ** 2, axis=(1, 2))
    worst = np.argsort(-squares)[: max(1, int(_FEW * len(squares)))]
    total = squares.sum()
    if total <= 0 or squares[worst].sum() < _MOST * total:
        return np.empty(0, int)
    return np.setdiff1d(np.arange(len(squares)), worst)
