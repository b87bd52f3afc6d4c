"""A fit that some grasps lead astray: the others are fitted without them, and all of them from there."""

from __future__ import annotations

import dataclasses

import numpy as np

from forcegrasp.identify.fit import Fit, fit_exactly, fit_once
from forcegrasp.identify.predict import predict
from forcegrasp.identify.simulators import Simulators
from forcegrasp.identify.target import Target

# Left out is this share of the grasps, but one at least, or those of an object, or else this larger share: whichever
# comes first of those that hold this much of what a fit leaves.
_FEW, _THIRD, _MOST = 1 / 8, 1 / 3, 0.6
# So often the others lead at most, for as long as the cost falls by more than this.
_ROUNDS, _NO_BETTER = 3, 0.99


def fit_led_by_others(fit: Fit, target: Target, simulators: Simulators) -> Fit:
    """The better of a fit and one that begins where the others lead, if some grasps hold most of what the fit leaves.

    A finger that is a little late meets an object that the other one has pushed, or does not: at such a place the error
    of a grasp jumps, and no slope leads across. The other grasps know the way. So they do where the parameters of one
    object alone are in another valley, and draw the gripper's with them; and where a finger that sticks and slips is
    out of step in some grasps: their slopes are those of another slip (least trimmed squares: Rousseeuw 1984).

    Args:
      fit: a fit of all grasps.
      target: the measurements.
      simulators: of the problem's grasps.
    """
    for _ in range(_ROUNDS):
        before, fit = fit, _once(fit, target, simulators)
        if fit.cost > _NO_BETTER * before.cost:
            break
    return fit


def _once(fit: Fit, target: Target, simulators: Simulators) -> Fit:
    left_out = _astray(fit, target)
    others = np.setdiff1d(np.arange(len(target.grasps)), left_out)
    if not (len(left_out) and len(others)):
        return fit
    part = fit.subset(others)
    of_others = Simulators(part.problem, exact=simulators.one_model)
    alone = fit_exactly(target.subset(others), part.problem, of_others, part.vector, part.jacobian)
    start = _own_anew(fit, left_out, alone, target, simulators)
    residual = target.residual(predict(simulators.exact, [fit.problem.case(start)])[0])
    if np.sum((fit.weight * residual) ** 2) + fit.problem.priors.cost(start) >= fit.cost:
        return fit
    again = fit_exactly(target, fit.problem, simulators, start, fit.jacobian)
    return min([fit, again], key=lambda one: one.cost)


def _own_anew(fit: Fit, left_out: np.ndarray, alone: Fit, target: Target, simulators: Simulators) -> np.ndarray:
    """Where a fit of all grasps begins, ``(p,)``: what those left out alone follow is fitted to them first."""
    led = dataclasses.replace(fit, vector=fit.moved(alone.problem, alone.vector))
    own, known = led.subset(left_out), {entry.name for entry in alone.problem.entries}
    free = np.array([entry.name not in known for entry in own.problem.entries])
    if not free.any():
        return led.vector
    of_own = Simulators(own.problem, exact=simulators.one_model)
    return led.moved(own.problem, fit_once(target.subset(left_out), own.problem, of_own, own.vector, free=free).vector)


def _astray(fit: Fit, target: Target) -> np.ndarray:
    """Indices of the fewest grasps, or an object's, that hold most of what is beyond the noise; none if none do."""
    squares = np.sum((fit.weight * fit.residual) ** 2 - (fit.weight * target.mask[..., None]) ** 2, axis=(1, 2))
    worst = np.argsort(-squares)
    few, third = worst[: max(1, int(_FEW * len(squares)))], worst[: int(_THIRD * len(squares))]
    objects = np.array([grasp.object for grasp in target.grasps])
    of_objects = [np.flatnonzero(objects == name) for name in target.objects]
    for some in (few, max(of_objects, key=lambda own: squares[own].sum()), third):
        if squares[some].sum() >= _MOST * squares.sum() > 0:
            return some
    return np.empty(0, int)
