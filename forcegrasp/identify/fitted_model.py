"""A fit as a model that can be written: parameters and effects with their intervals."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from forcegrasp.identify.fit import Fit
from forcegrasp.identify.givens import errors_by_givens
from forcegrasp.identify.intervals import intervals, standard_errors, warnings
from forcegrasp.identify.loading import Loaded
from forcegrasp.identify.target import Target
from forcegrasp.models.model_file import Fitted, FoundEffect, Model


def model_of(fit: Fit, target: Target, loaded: Loaded, numerical: Sequence[np.ndarray]) -> Model:
    """A fit as a model that can be written."""
    problem, measured = fit.problem, loaded.measured
    errors = standard_errors(fit, target, [*numerical, *errors_by_givens(fit, target, measured)])
    base: dict[str, Fitted] = {}
    objects: dict[str, dict[str, Fitted]] = {}
    grasps: dict[str, dict[str, Fitted]] = {}
    for entry, (value, low, high) in zip(problem.entries, intervals(fit, errors), strict=True):
        if entry.effect is not None or entry.parameter not in loaded.gripper.parameters:  # a recording's setting
            continue
        fitted = Fitted(value, low, high, entry.unit)
        scope = loaded.gripper.parameters[entry.parameter].scope
        first = problem.grasps[int(np.flatnonzero(entry.members)[0])]
        if scope == "gripper":
            base[entry.parameter] = fitted
        elif scope == "object":
            objects.setdefault(first.object, {})[entry.parameter] = fitted
        else:
            owner = first.session if scope == "recording" else first.name
            grasps.setdefault(owner, {})[entry.parameter] = fitted
    data = {"set": loaded.measured.name, "fingerprint": loaded.measured.fingerprint}
    warned, found = tuple(warnings(fit, errors)), effects_of_fit(fit, target, errors)
    return Model(loaded.gripper, base, objects, grasps, found, data, warned, _noise_of(target))


def effects_of_fit(fit: Fit, target: Target, errors: np.ndarray) -> tuple[FoundEffect, ...]:
    """The effects of a fit with their intervals, and the rounding that readings show.

    Args:
      fit: the fit.
      target: the measurements.
      errors: standard errors of the coordinates, ``(p,)``.
    """
    parameters: list[dict[str, Fitted]] = [{} for _ in fit.problem.effects]
    for entry, numbers in zip(fit.problem.entries, intervals(fit, errors), strict=True):
        if entry.effect is not None:
            parameters[entry.effect][entry.parameter] = Fitted(*numbers, entry.unit)
    found = [FoundEffect(*one.kind, values) for one, values in zip(fit.problem.effects, parameters, strict=True)]
    if (rounding := target.rounding) is not None:
        steps = zip(rounding.effect.parameters, rounding.values.tolist(), strict=True)
        found.append(FoundEffect(*rounding.kind, {p.name: Fitted(s, s, s, p.unit) for p, s in steps}))
    return tuple(found)


def _noise_of(target: Target) -> tuple[float, float] | None:
    """Noise of positions and forces, before rounding, for a policy to be trained with; None if it is not known."""
    kinds = [target.sensor_sigma[part] for part in (target.axis.positions, target.axis.forces)]
    noise = [float(np.mean(sigma)) for sigma in kinds if len(sigma) and (sigma > 0).all()]
    return (noise[0], noise[1]) if len(noise) == 2 else None
