"""Intervals of fitted parameters, and warnings that they deserve."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.signal import lfilter
from scipy.sparse.csgraph import connected_components

from forcegrasp.identify.fit import Fit
from forcegrasp.identify.plateaus import plateaus
from forcegrasp.identify.target import Target

#: Half width of a 95 % interval in standard errors.
Z95 = 1.96
# Residuals may lean on the reading before by so much; slower, they can't be told from a model's error.
_SLOWEST = 0.95
# Share of the range between its bounds up to which a parameter is at one.
_AT_BOUND = 1e-3
# Correlation of two parameters above which data don't tell them apart, and the share of their values up to which their
# intervals may reach: where both are narrower, data tell them apart all the same.
_CONFOUNDED, _WELL_KNOWN = 0.98, 0.1


def standard_errors(fit: Fit, target: Target, numerical: Sequence[np.ndarray] = ()) -> np.ndarray:
    """Standard errors of the fitted coordinates, ``(p,)``: by chance, and by the model's own numerical error.

    Where a size jumps, its 95 % interval reaches at least as far as nothing changes; of what changes nothing at all, as
    far as its bounds.

    Args:
      fit: the fit.
      target: the measurements.
      numerical: from :func:`~forcegrasp.identify.noise_floor.numerical_error`, each ``(G, S, C)``.
    """
    errors = np.sqrt(chance_errors(fit) ** 2 + np.sum(numerical_shifts(fit, numerical) ** 2, axis=0))
    of_jumps = np.array([entry.jumps for entry in fit.problem.entries], bool)
    idle = ~of_jumps & ~fit.slopes.any(axis=0)
    errors = np.where(idle, (fit.problem.high - fit.problem.low) / Z95, errors)
    return np.maximum(errors, plateaus(fit, target) / Z95)


def chance_errors(fit: Fit) -> np.ndarray:
    """Standard errors of the fitted coordinates by chance alone, ``(p,)``.

    The largest of three figures: white noise of the known size; the scatter from grasp to grasp, which also sees
    residuals that are correlated in time, but not of what few grasps tell; and noise as large as the residuals are, and
    as correlated with the reading before.
    """
    inverse = fit.covariance()
    slopes = np.einsum("gskp,gsk->gp", fit.jacobian, fit.weight**2 * fit.residual, optimize=True)
    count, p = slopes.shape
    freedom = count / max(1, count - min(p, count - 1))
    priors = fit.problem.priors.information
    by_grasp = inverse @ (slopes.T @ slopes * min(freedom, 4.0) + priors) @ inverse
    with_memory = inverse @ (_covariance_of_slope(fit) + priors) @ inverse
    return np.sqrt(np.maximum.reduce([np.diag(inverse), np.diag(by_grasp), np.diag(with_memory), np.zeros(p)]))


def _covariance_of_slope(fit: Fit) -> np.ndarray:
    """Covariance of the cost's slope, ``(p, p)``, if noise is a first-order autoregression like the residuals.

    The middle of the sandwich of Huber (1967) with that autocovariance in place of the residuals' own, which of a
    parameter of a single grasp are orthogonal to its slopes.
    """
    total = np.zeros((len(fit.vector),) * 2)
    for channel in range(fit.residual.shape[-1]):
        slopes = fit.weight * fit.jacobian[:, :, channel]
        left = fit.weight[..., 0] * fit.residual[..., channel]
        squares = max(float(np.sum(left**2)), 1e-12)
        leaning = float(np.clip(np.sum(left[:, 1:] * left[:, :-1]) / squares, 0.0, _SLOWEST))
        sums = np.asarray(lfilter([1.0], [1.0, -leaning], slopes, axis=1))  # of all before, ever less of it
        cross, inner = (np.einsum("gsp,gsq->pq", slopes, other, optimize=True) for other in (sums, slopes))
        total += squares / max(1, np.count_nonzero(left)) * (cross + cross.T - inner)
    return total


def numerical_shifts(fit: Fit, numerical: Sequence[np.ndarray]) -> np.ndarray:
    """By how much each numerical error of the model would move the coordinates, ``(errors, p)``."""
    inverse = fit.covariance()
    shifts = [inverse @ (fit.slopes.T @ fit.weighted(one)) for one in numerical]
    return np.array(shifts).reshape(len(shifts), len(fit.vector))


def intervals(fit: Fit, errors: np.ndarray) -> list[tuple[float, float, float]]:
    """Value and 95 % interval of each parameter in its own unit, cut at its bounds."""
    found = []
    for entry, x, error in zip(fit.problem.entries, fit.vector, errors, strict=True):
        found.append((entry.value(x), entry.value(x - Z95 * error), entry.value(x + Z95 * error)))
    return found


def reached_bound(value: float, low: float, high: float, logarithmic: bool, null: float = float("nan")) -> float | None:
    """The bound at which a fitted value ended; None if at neither, or where an effect is simply not there.

    Args:
      value: the parameter, in its own unit.
      low: its lower bound.
      high: its upper bound.
      logarithmic: whether it is fitted by its logarithm.
      null: where an effect's parameter does nothing.
    """
    x, least, most = np.log((max(value, low), low, high)) if logarithmic else (value, low, high)
    margin = _AT_BOUND * (most - least)
    for bound, near in ((low, x - least < margin), (high, most - x < margin)):
        if near and bound != null:
            return bound
    return None


def hardly_fixed(fit: Fit, errors: np.ndarray) -> np.ndarray:
    """Whether a parameter's interval is as wide as the range between its bounds, ``(p,)``."""
    return Z95 * errors > 0.5 * (fit.problem.high - fit.problem.low)


def warnings(fit: Fit, errors: np.ndarray) -> list[str]:
    """A line for each parameter at a bound, one for all that the data hardly fix, one for all that are confounded."""
    entries, lines = fit.problem.entries, []
    for entry, value in zip(entries, fit.values, strict=True):
        bound = reached_bound(float(value), entry.low, entry.high, entry.logarithmic, entry.null)
        pure = entry.unit == "1"
        if bound is not None and not (pure and bound in (0.0, 1.0)):  # a share has all or nothing as its natural limits
            unit = "" if pure else f" {entry.unit}"
            lines.append(f"{entry.name} ended at its bound {bound:g}{unit}: doubt the model, or widen it")
    loose = [entry.name for entry, wide in zip(entries, hardly_fixed(fit, errors), strict=True) if wide]
    if loose:
        lines.append(f"{listed(loose)} {'is' if len(loose) == 1 else 'are'} hardly fixed by these data")
    together = _confounded(fit, errors)
    if together:
        lines.append(f"{'; '.join(together)}: only together are they fixed")
    return lines


def _confounded(fit: Fit, errors: np.ndarray) -> list[str]:
    """Groups of parameters of which each can be replaced by others of its group, in words; alike ones are one group."""
    wide = [high - low > 2 * _WELL_KNOWN * abs(value) for value, low, high in intervals(fit, errors)]
    covariance = fit.covariance()
    sigma = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    correlation = covariance / np.outer(sigma, sigma)
    linked = np.abs(correlation) > _CONFOUNDED
    count, group = connected_components(linked, directed=False)
    found: dict[tuple[str, ...], list[tuple[list[str], float]]] = {}
    for members in (np.flatnonzero(group == k) for k in range(count)):
        if len(members) > 1 and any(wide[i] for i in members):
            inside = np.triu(np.where(linked, correlation, 0.0)[np.ix_(members, members)], k=1).ravel()
            entries = [fit.problem.entries[i] for i in members]
            strongest = float(inside[np.argmax(np.abs(inside))])
            found.setdefault(tuple(e.parameter for e in entries), []).append(([e.name for e in entries], strongest))
    lines = []
    for parameters, alike in found.items():
        names, strongest = alike[0][0], max((c for _, c in alike), key=abs)
        if len(alike) == 1:
            lines.append(f"{listed(names)} are confounded (correlation {strongest:.3f})")
        else:
            several = f"in {len(alike)} objects or grasps (correlation up to {strongest:.3f})"
            lines.append(f"{listed(parameters)} are confounded {several}")
    return lines


def listed(names: Sequence[str], word: str = "and") -> str:
    """a, b and c."""
    *first, last = names
    return f"{', '.join(first)} {word} {last}" if first else last
