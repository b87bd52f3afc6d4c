"""Errors on grasps that a fit has not seen, without fitting anew: one linear step takes each fold's grasps out."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from forcegrasp.identify.fit import Fit
from forcegrasp.identify.target import Target
from forcegrasp.measure.schema import MeasuredGrasp

#: Number of folds where a set does not say which grasps to check with.
FOLDS = 6
# What one unit of a coordinate costs in a fold's step, in squared residuals: a parameter that the other grasps don't
# fix stays where it is.
_RIDGE = 1.0
# Residuals beyond this many σ count linearly: one bad grasp must not decide.
_HEAVY = 6.0


def make_folds(grasps: Sequence[MeasuredGrasp]) -> list[np.ndarray]:
    """Indices of the grasps that each fold holds out: whole grasps, each object spread over the folds.

    Of a servo's recordings, if there are enough of them, each is held out as a whole.

    If the set marks grasps with ``split: check``, they are the one fold.
    """
    check = np.array([i for i, g in enumerate(grasps) if g.split == "check"], dtype=int)
    if len(check):
        return [check]
    sessions = list(dict.fromkeys(g.session for g in grasps))
    if not any(g.object for g in grasps) and len(sessions) >= FOLDS:  # a servo's recordings, whole
        return [
            np.array([i for i, g in enumerate(grasps) if g.session in sessions[k::FOLDS]], dtype=int)
            for k in range(FOLDS)
        ]
    order = sorted(range(len(grasps)), key=lambda i: (grasps[i].object, grasps[i].session, i))
    folds = min(FOLDS, len(grasps))
    return [np.array(sorted(order[k::folds]), dtype=int) for k in range(folds)]


def heldout_residual(fit: Fit, target: Target, folds: Sequence[np.ndarray]) -> np.ndarray:
    """Residuals of each grasp under the parameters that the other folds' grasps give, ``(G, S, C)``; NaN if in no fold.

    Exact where the model is linear in its parameters over their uncertainty.
    """
    p = len(fit.problem)
    jacobian, residual = fit.jacobian, fit.residual
    inner = np.einsum("gskp,gskq->gpq", jacobian, jacobian, optimize=True)
    slope = np.einsum("gskp,gsk->gp", jacobian, residual, optimize=True)
    held = np.full(residual.shape, np.nan)
    for fold in folds:
        rest = np.setdiff1d(np.arange(len(target.grasps)), fold)
        if len(rest) == 0:
            continue
        step = np.linalg.lstsq(inner[rest].sum(axis=0) + _RIDGE * np.eye(p), slope[rest].sum(axis=0), rcond=None)[0]
        held[fold] = residual[fold] - jacobian[fold] @ step
    return held


def log_likelihood(residual: np.ndarray) -> np.ndarray:
    """Log-likelihood of each grasp up to a constant, robust against heavy tails, ``(..., G)``.

    Args:
      residual: in units of the noise, ``(..., G, S, C)``.
    """
    size = np.abs(residual)
    loss = np.where(size <= _HEAVY, 0.5 * size**2, _HEAVY * (size - 0.5 * _HEAVY))
    return -np.nansum(loss, axis=(-1, -2))


def rms(residual: np.ndarray, target: Target, where: np.ndarray | None = None) -> float:
    """Root mean square of the residuals of existing samples; NaN if there are none.

    Args:
      residual: in units of the noise, ``(G, S, C)``; grasps of no fold are NaN and left out.
      where: further choice of samples and signals, broadcast to ``(G, S, C)``.
    """
    chosen = np.broadcast_to(target.mask[:, :, None] & np.isfinite(residual), residual.shape)
    if where is not None:
        chosen = chosen & where
    return float(np.sqrt(np.mean(residual[chosen] ** 2))) if chosen.any() else float("nan")
