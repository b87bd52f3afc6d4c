"""Intervals of fitted parameters, and warnings that they deserve."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from forcegrasp.compare.fit import Fit

#: Half width of a 95 % interval in standard errors.
Z95 = 1.96
# Correlation of two parameters above which data don't tell them apart.
_CONFOUNDED = 0.98


def standard_errors(fit: Fit, numerical: Sequence[np.ndarray] = ()) -> np.ndarray:
    """Standard errors of the fitted coordinates, ``(p,)``.

    The larger of two figures: white noise of the known size, and the scatter from grasp to grasp, which also sees
    residuals that are correlated in time. The model's own numerical error adds what it would shift the parameters by.

    Args:
      fit: the fit.
      numerical: from :func:`~forcegrasp.compare.floor.numerical_error`, each ``(G, S, 4)``.
    """
    inverse = fit.covariance()
    slopes = np.einsum("gskp,gsk->gp", fit.jacobian, fit.residual, optimize=True)
    count, p = slopes.shape
    freedom = count / max(1, count - min(p, count - 1))
    by_grasp = inverse @ (slopes.T @ slopes * min(freedom, 4.0)) @ inverse
    flat = fit.jacobian.reshape(-1, p)
    shifts = [inverse @ (flat.T @ n.ravel()) for n in numerical]
    variance = np.maximum(np.diag(inverse), np.diag(by_grasp)) + sum((s**2 for s in shifts), np.zeros(p))
    return np.sqrt(np.maximum(variance, 0.0))


def intervals(fit: Fit, errors: np.ndarray) -> list[tuple[float, float, float]]:
    """Value and 95 % interval of each parameter in its own unit, cut at its bounds."""
    found = []
    for entry, x, error in zip(fit.problem.entries, fit.vector, errors, strict=True):
        found.append((entry.value(x), entry.value(x - Z95 * error), entry.value(x + Z95 * error)))
    return found


def warnings(fit: Fit, errors: np.ndarray) -> list[str]:
    """One line for each parameter that ended at a bound, that the data hardly fix, or that another one can replace."""
    lines = []
    for entry, x, low, high, error in zip(
        fit.problem.entries, fit.vector, fit.problem.low, fit.problem.high, errors, strict=True
    ):
        margin = 1e-3 * (high - low)
        for bound, at in ((entry.low, x - low < margin), (entry.high, high - x < margin)):
            if at and bound != entry.null:
                lines.append(f"{entry.name} ended at its bound {bound:g} {entry.unit}: widen it or doubt the model")
        if Z95 * error > 0.5 * (high - low):
            lines.append(f"{entry.name} is hardly fixed by these data")
    covariance = fit.covariance()
    sigma = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    correlation = covariance / np.outer(sigma, sigma)
    for i, j in zip(*np.triu_indices(len(sigma), k=1), strict=True):
        if abs(correlation[i, j]) > _CONFOUNDED:
            one, other = fit.problem.entries[i].name, fit.problem.entries[j].name
            lines.append(
                f"{one} and {other} are confounded (correlation {correlation[i, j]:.3f}): only together are they fixed"
            )
    return lines
