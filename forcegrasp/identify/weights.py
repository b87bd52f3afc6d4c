"""Lets each recording of a servo count alike, however much of it a model misses."""

from __future__ import annotations

import dataclasses

import numpy as np

from forcegrasp.identify.fit import Fit, fit_exactly
from forcegrasp.identify.simulators import Simulators
from forcegrasp.identify.target import Target

# Rounds of fitting and weighing, and the largest factor by which weights may still change at the end.
_ROUNDS, _SAME = 2, 1.2


def reweigh(target: Target, fit: Fit, simulators: Simulators) -> tuple[Target, Fit]:
    """Weighs recordings by what a fit leaves of them, and fits again; neither changes where there is one recording.

    A model that lacks something misses the fastest motion by most, and counted by the noise that motion would decide
    alone. So the size of the errors is estimated for each recording, together with the model, as for a likelihood of
    Gaussian errors of unknown size; it is never taken for smaller than the noise.
    """
    for _ in range(_ROUNDS if len(target.recordings) > 1 else 0):
        weight = weights(target, fit.residual)
        if np.all(np.abs(np.log(weight / target.weight)) < np.log(_SAME)):
            break
        target = dataclasses.replace(target, weight=weight)
        fit = fit_exactly(target, fit.problem, simulators, fit.vector, fit.jacobian)
    return target, fit


def weights(target: Target, residual: np.ndarray) -> np.ndarray:
    """By which each grasp's residuals count, ``(G, 1, 1)``; 1 where there is one recording, or none.

    Args:
      target: the measurements.
      residual: in units of the noise, ``(G, S, C)``; grasps of no fold are NaN.
    """
    weight, recordings = np.ones(target.weight.shape), target.recordings
    for members in recordings.values() if len(recordings) > 1 else ():
        inside = residual[members][target.mask[members]]
        inside = inside[np.isfinite(inside)]
        weight[members] = 1 / max(1.0, float(np.sqrt(np.mean(inside**2)))) if inside.size else 1.0
    return weight
