"""Errors on grasps that a fit has not seen, without fitting anew: one linear step takes each fold's grasps out."""

from __future__ import annotations

from collections.abc import Sequence
from weakref import WeakKeyDictionary

import numpy as np

from forcegrasp.identify.fit import Fit
from forcegrasp.identify.predict import predict
from forcegrasp.identify.simulators import cheap_tier
from forcegrasp.identify.target import Target
from forcegrasp.identify.weights import weights
from forcegrasp.measure.schema import MeasuredGrasp
from forcegrasp.replay.replay import Replay

#: Number of folds where a set does not say which grasps to check with.
FOLDS = 6
# What one unit of a coordinate costs in a fold's step, in squared residuals: a parameter that the other grasps don't
# fix stays where it is.
_RIDGE = 1.0
# Damping of steps, the least that keeps a step that all grasps ask for so short, in coordinates.
_DAMPINGS, _SHORT = (0.0, 1e-3, 1e-2, 0.1, 1.0, 10.0), 0.1
# Residuals beyond this many σ count linearly: one bad grasp must not decide.
_HEAVY = 6.0
# A step that changes more than this share of a fold's squares is simulated, in these lengths: of a servo whose fit is
# further than so many times the noise off, and of any fit that is nearer, where steps are small if they are right.
_FAR, _COUNTS, _COUNTS_NEAR, _SHARES = 3.0, 0.02, 0.05, (1.0, 0.5, 0.25, 0.1)
# So is one that leaves less than this share of a fold's squares: what was not fitted to is not fitted so much better.
# And one that leaves so many times as much: where others hardly fix what a fold shows, a straight step goes anywhere.
_TOO_GOOD, _TOO_BAD = 0.25, 10.0
# A step by which a fold leaves so many times the squares of the fit is held against shorter ones.
_FAR_WORSE = 4.0
# What fits leave of held-out grasps, with target and folds: a search, its doubts and its report ask for the same.
_KNOWN: WeakKeyDictionary[Fit, list[tuple[Target, Sequence[np.ndarray], np.ndarray]]] = WeakKeyDictionary()


def make_folds(grasps: Sequence[MeasuredGrasp]) -> list[np.ndarray]:
    """Indices of the grasps that each fold holds out: whole grasps, each object spread over the folds.

    A servo's recordings are held out as wholes; of a single one, its windows.

    If the set marks grasps with ``split: check``, they are the one fold.
    """
    if len(check := to_check_with(grasps)):
        return [check]
    sessions = list(dict.fromkeys(g.session for g in grasps))
    if not any(g.object for g in grasps) and len(sessions) > 1:
        count = min(FOLDS, len(sessions))
        return [
            np.array([i for i, g in enumerate(grasps) if g.session in sessions[k::count]], dtype=int)
            for k in range(count)
        ]
    order = sorted(range(len(grasps)), key=lambda i: (grasps[i].object, grasps[i].session, i))
    folds = min(FOLDS, len(grasps))
    return [np.array(sorted(order[k::folds]), dtype=int) for k in range(folds)]


def to_check_with(grasps: Sequence[MeasuredGrasp]) -> np.ndarray:
    """Indices of the grasps that the set marks with ``split: check``: on these, if there are any, errors are told."""
    return np.array([i for i, g in enumerate(grasps) if g.split == "check"], dtype=int)


def evidence_folds(grasps: Sequence[MeasuredGrasp]) -> list[np.ndarray]:
    """Indices of the grasps that each fold holds out where effects are judged: of all, whatever the set marks.

    What is marked to check with is held out together, and the others by turns: an effect that these show is there, also
    where what is held out shows something else as well. Of a servo's single recording to fit nothing else is held out.
    """
    check = to_check_with(grasps)
    rest = np.setdiff1d(np.arange(len(grasps)), check)
    others = [grasps[i] for i in rest]
    one_recording = not any(g.object for g in others) and len({g.session for g in others}) < 2
    if not len(check) or one_recording:
        return make_folds(grasps)
    return [check, *(rest[fold] for fold in make_folds(others))]


def heldout_residual(fit: Fit, target: Target, folds: Sequence[np.ndarray]) -> np.ndarray:
    """Residuals of each grasp under the parameters that the other folds' grasps give, ``(G, S, C)``; NaN if in no fold.

    One linear step from the fit of all grasps takes a fold's own out. That is exact where the model is linear in its
    parameters over their uncertainty. A step that counts, of a servo or near the noise, is simulated, and shortened
    until the other folds' error falls. What was asked of a fit before is known.

    What no other grasp tells, such as where its object was, is a grasp's own, and fitted to it beside the others' step.
    Where a fit ended short of what its slopes promise, all grasps ask for a step, too: a fold's is what the others ask
    for besides, and damped until the step of all is small. What is a servo's recording's own stays as it is: a clock
    that is off makes up for much that motions should show.
    """
    for of, known_folds, held in _KNOWN.setdefault(fit, []):
        if of is target and len(known_folds) == len(folds) and all(map(np.array_equal, known_folds, folds)):
            return held.copy()
    held = _heldout_residual(fit, target, folds)
    _KNOWN[fit].append((target, folds, held))
    return held.copy()


def _heldout_residual(fit: Fit, target: Target, folds: Sequence[np.ndarray]) -> np.ndarray:
    jacobian, residual = fit.jacobian, fit.residual
    inner, slope = normal_equations(fit)
    held = np.full(residual.shape, np.nan)
    doubtful: list[tuple[np.ndarray, np.ndarray]] = []
    far = np.sum(residual**2) > _FAR**2 * target.readings
    counts = (_COUNTS if target.gripper.is_servo else np.inf) if far else _COUNTS_NEAR
    of_all, damping = (np.zeros(len(fit.vector)), 0.0) if target.gripper.is_servo else _of_all(fit, inner, slope)
    for fold in folds:
        rest = np.setdiff1d(np.arange(len(target.grasps)), fold)
        if len(rest) == 0:
            continue
        step = step_of(fit, inner[rest].sum(axis=0), slope[rest].sum(axis=0), damping)
        if not target.gripper.is_servo:
            own = np.flatnonzero(~fit.problem.concerned[rest].any(axis=0))
            step = _with_own(fit, step, own, inner[fold].sum(axis=0), slope[fold].sum(axis=0)) - of_all
            step = np.clip(fit.vector + step, fit.problem.low, fit.problem.high) - fit.vector
        change, squares = jacobian[fold] @ step, np.sum(residual[fold] ** 2)
        held[fold] = residual[fold] - change
        left = np.sum(held[fold] ** 2)
        if np.sum(change**2) > counts * squares or not _TOO_GOOD * squares <= left <= _TOO_BAD * squares:
            doubtful.append((fold, step))
    if doubtful:
        _simulate(fit, target, doubtful, held)
    return held


def normal_equations(fit: Fit) -> tuple[np.ndarray, np.ndarray]:
    """Each grasp's products of a fit's slopes with each other, ``(G, p, p)``, and with what it leaves, ``(G, p)``."""
    weighted, off = fit.weight[..., None] * fit.jacobian, fit.weight * fit.residual
    inner = np.einsum("gskp,gskq->gpq", weighted, weighted, optimize=True)
    return inner, np.einsum("gskp,gsk->gp", weighted, off, optimize=True)


def _of_all(fit: Fit, inner: np.ndarray, slope: np.ndarray) -> tuple[np.ndarray, float]:
    """The step that all grasps ask for, ``(p,)``, and the damping that keeps it small.

    Where slopes promise something far away, and no step there held it, those of a fold lead nowhere either.
    """
    step, damping = np.zeros(len(fit.vector)), 0.0
    for damping in _DAMPINGS:
        step = step_of(fit, inner.sum(axis=0), slope.sum(axis=0), damping)
        if np.abs(step).max(initial=0.0) < _SHORT:
            break
    return step, damping


def step_of(fit: Fit, inner: np.ndarray, slope: np.ndarray, damping: float = 0.0) -> np.ndarray:
    """The linear step from a fit, ``(p,)``, that some grasps ask for, within the bounds.

    Args:
      fit: of all grasps.
      inner, slope: sums of theirs, from :func:`normal_equations`.
      damping: in shares of the diagonal (Levenberg 1944, Marquardt 1963).
    """
    priors = fit.problem.priors
    inner = inner + damping * np.diag(np.diag(inner)) + priors.information + _RIDGE * np.eye(len(slope))
    step = np.linalg.lstsq(inner, slope + priors.pull(fit.vector), rcond=None)[0]
    return np.clip(fit.vector + step, fit.problem.low, fit.problem.high) - fit.vector


def _with_own(fit: Fit, step: np.ndarray, own: np.ndarray, inner: np.ndarray, slope: np.ndarray) -> np.ndarray:
    """A step ``(p,)`` with what those of a fold alone tell, where they ask for it once the others have moved.

    Args:
      fit: of all grasps.
      step: that the others ask for.
      own: indices of the coordinates that the others do not concern.
      inner, slope: sums of the fold's, from :func:`normal_equations`.
    """
    if not own.size:
        return step
    others, priors, step = np.setdiff1d(np.arange(len(step)), own), fit.problem.priors, step.copy()
    left = slope[own] - inner[np.ix_(own, others)] @ step[others] + priors.pull(fit.vector)[own]
    known = (inner + priors.information)[np.ix_(own, own)] + _RIDGE * np.eye(len(own))
    wanted = fit.vector[own] + np.linalg.lstsq(known, left, rcond=None)[0]
    step[own] = np.clip(wanted, fit.problem.low[own], fit.problem.high[own]) - fit.vector[own]
    return step


def _simulate(fit: Fit, target: Target, doubtful: list[tuple[np.ndarray, np.ndarray]], held: np.ndarray) -> None:
    """Replaces residuals of folds by simulated ones, of the longest step that lowers the error of the others.

    Or of a shorter one that lowers it by more, where a fold's own error rises far: slopes that lead there do not hold
    for so long. The cheap model simulates them: by how much it is off is known where the fit ended.
    """
    problem = fit.problem
    replay = Replay(problem.gripper, problem.grasps, cheap_tier(problem.gripper))
    squares = np.sum((fit.weight * fit.residual) ** 2, axis=(1, 2))
    for fold, _ in doubtful:  # if no step lowers it, the others' own optimum is where the fit is
        held[fold] = fit.residual[fold]
    fell = dict.fromkeys((int(fold[0]) for fold, _ in doubtful), -1.0)
    for scale in _SHARES:
        vectors = [fit.vector + scale * step for _, step in doubtful]
        signals = predict(replay, [problem.case(vector) for vector in vectors]) + fit.correction
        shorter = []
        for (fold, step), residual in zip(doubtful, target.residual(signals), strict=True):
            after = np.sum((fit.weight * residual) ** 2, axis=(1, 2))
            fall = np.delete(squares - after, fold).sum()
            before = fell[int(fold[0])]
            if lowers_more := fall >= max(before, 0.0):
                fell[int(fold[0])], held[fold] = fall, residual[fold]
            far_worse = after[fold].sum() > _FAR_WORSE * squares[fold].sum()
            if (lowers_more and far_worse) or not (lowers_more or before >= 0):
                shorter.append((fold, step))
        if not (doubtful := shorter):
            return


def log_likelihood(residual: np.ndarray) -> np.ndarray:
    """Log-likelihood of each grasp up to a constant, robust against heavy tails, ``(..., G)``.

    Args:
      residual: in units of the noise, ``(..., G, S, C)``.
    """
    size = np.abs(residual)
    loss = np.where(size <= _HEAVY, 0.5 * size**2, _HEAVY * (size - 0.5 * _HEAVY))
    return -np.nansum(loss, axis=(-1, -2))


def log_likelihood_of_sizes(residual: np.ndarray, target: Target) -> np.ndarray:
    """The same of a servo's windows, ``(G,)``, if errors of each recording have a size of their own: :mod:`.weights`.

    By what another model leaves they must not be judged: of much that it misses an effect could take but little off.

    Args:
      residual: in units of the noise, ``(G, S, C)``; windows of no fold are NaN.
      target: the measurements.
    """
    weight = weights(target, residual)
    readings = np.sum(target.mask, axis=1) * residual.shape[-1]
    return log_likelihood(weight * residual) + readings * np.log(weight[:, 0, 0])


def rms(residual: np.ndarray, target: Target, where: np.ndarray | None = None) -> float:
    """Root mean square of the residuals of existing samples; NaN if there are none.

    Of several recordings of a servo it is the geometric mean of theirs: the fastest motion must not stand for all.

    Args:
      residual: in units of the noise, ``(G, S, C)``; grasps of no fold are NaN and left out.
      where: further choice of samples and signals, broadcast to ``(G, S, C)``.
    """
    chosen = np.broadcast_to(target.mask[:, :, None] & np.isfinite(residual), residual.shape)
    if where is not None:
        chosen = chosen & where
    groups = target.recordings.values() if len(target.recordings) > 1 else [slice(None)]
    inside = [residual[group][chosen[group]] for group in groups]
    squares = [(len(one), np.mean(one**2)) for one in inside if len(one)]
    if not squares:
        return float("nan")
    counts, means = np.array(squares).T
    return float(np.exp(0.5 * np.average(np.log(np.maximum(means, 1e-12)), weights=counts)))


def rms_of_recordings(residual: np.ndarray, target: Target) -> dict[str, float]:
    """Root mean square residual ÷ noise of each of a servo's recordings, of those that were held out.

    Args:
      residual: in units of the noise, ``(G, S, C)``; grasps of no fold are NaN.
      target: the measurements.
    """
    recordings = target.recordings.items()
    squares = {name: residual[members][target.mask[members]] ** 2 for name, members in recordings}
    held = {name: one[np.isfinite(one)] for name, one in squares.items()}
    return {name: float(np.sqrt(one.mean())) for name, one in held.items() if len(one)}


def rms_of_grasps(residual: np.ndarray, target: Target) -> np.ndarray:
    """Root mean square residual ÷ noise of each grasp, ``(G,)``.

    Args:
      residual: in units of the noise, 0 where there is no sample, ``(G, S, C)``.
      target: the measurements.
    """
    readings = np.maximum(target.mask.sum(axis=1), 1) * residual.shape[-1]
    return np.sqrt(np.sum(residual**2, axis=(1, 2)) / readings)
