"""What the objects of a table have in common: one slope, or one onset."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import f

from forcegrasp.final_force.shapes import Candidate, Rows, ShapeFit, bootstrap, degrees_of_freedom, rms


def slopes_differ(best: Candidate, rows: Mapping[str, Rows]) -> float | None:
    """Probability of slopes that scatter this much if there were one: an F test over the objects."""
    if len(rows) < 2:
        return None
    slopes, errors = np.array([_slope_error(best, rows, name) for name in rows]).T
    weights = 1 / np.maximum(errors, 1e-9) ** 2
    mean = np.sum(weights * slopes) / np.sum(weights)
    spread = np.sum(weights * (slopes - mean) ** 2) / (len(slopes) - 1)
    return float(f.sf(spread, len(slopes) - 1, degrees_of_freedom(best.shape, rows)))


def _slope_error(best: Candidate, rows: Mapping[str, Rows], name: str) -> tuple[float, float]:
    """Slope and its standard error by the linearised fit with the table's common scatter."""
    fit, x = best.fits[name], rows[name].delta_m
    scatter = np.sqrt(np.sum(best.residual**2) / degrees_of_freedom(best.shape, rows))
    jacobian = []
    for index, value in enumerate(fit.values):
        step = 1e-4 * max(abs(value), 1e-4)
        moved = fit.values.copy()
        moved[index] += step
        other = ShapeFit(fit.shape, moved, fit.residual, fit.left_out)
        jacobian.append((other.predict(x) - fit.predict(x)) / step)
    covariance = np.linalg.pinv(np.array(jacobian) @ np.array(jacobian).T)
    return fit.slope, float(scatter * np.sqrt(max(covariance[0, 0], 0.0)))


def slope_ratio(
    best: Candidate, rows: Mapping[str, Rows], rng: np.random.Generator
) -> tuple[float, float, float] | None:
    """Largest ÷ smallest slope with its 95 % interval; None for one object."""
    if len(rows) < 2:
        return None
    order = sorted(best.fits, key=lambda name: best.fits[name].slope)
    low, high = (bootstrap(best.fits[name], rows[name].delta_m, rng)[:, 0] for name in (order[0], order[-1]))
    value = best.fits[order[-1]].slope / best.fits[order[0]].slope
    least, most = np.quantile(high / low, (0.025, 0.975))
    return value, float(least), float(most)


def shared_onset(rows: Mapping[str, Rows], fits: Mapping) -> dict[str, float]:
    """rms error with one onset for all objects: as a "travel" Δq, or as a "force" on the reading."""
    if len(rows) < 2:
        return {}
    names, dead = list(rows), {s.name: s for s in fits}["dead_zone"]
    slopes = np.array([fits[dead][name].slope for name in names])
    onsets = np.array([fits[dead][name].values[1] for name in names])

    def residual(vector: np.ndarray, kind: str) -> np.ndarray:
        slope, onset = vector[:-1], vector[-1]  # of a travel in mm, of a force in N
        missing = slope * onset * 1e-3 if kind == "travel" else np.full(len(names), onset)
        curves = [np.maximum(s * rows[n].delta_m - z, 0.0) for s, z, n in zip(slope, missing, names, strict=True)]
        return np.concatenate(curves) - np.concatenate([rows[n].force_n for n in names])

    found = {}
    for kind, start in (("travel", onsets.mean() * 1e3), ("force", float((slopes * onsets).mean()))):
        fit = least_squares(residual, np.r_[slopes, start], args=(kind,), x_scale=np.r_[slopes, max(start, 1e-3)])
        found[kind] = rms(fit.fun)
    return found
