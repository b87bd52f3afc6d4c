"""Puts a model beside a measurement set: the base model, fitted to it, or one that is given."""

from __future__ import annotations

import dataclasses

import numpy as np

from forcegrasp.errors import ConfigError, PhysicsError
from forcegrasp.identify.base_fit import BaseFit, check_gradient, cost_tolerance, fit_base
from forcegrasp.identify.fit import fit_exactly, fit_once, with_own_slopes
from forcegrasp.identify.larger_steps import lead_astray, with_own_steps
from forcegrasp.identify.loading import Loaded
from forcegrasp.identify.problem import Problem
from forcegrasp.identify.progress import Progress
from forcegrasp.identify.simulators import Simulators
from forcegrasp.identify.target import Target, make_target
from forcegrasp.identify.weights import reweigh, weights
from forcegrasp.measure import MeasurementSet
from forcegrasp.models.model_file import Model
from forcegrasp.physics.sensors import is_rounding
from forcegrasp.replay.replay import NOWHERE


def fit_model(
    loaded: Loaded[MeasurementSet], seed: int, progress: Progress, hasty: bool = False
) -> tuple[Target, Simulators, BaseFit]:
    """Fits the base model to a set, from several starts; for ``hasty`` see :func:`.fit_base`.

    Raises:
      PhysicsError: if it diverges wherever the fit went.
    """
    target = make_target(loaded.measured, loaded.gripper)
    problem = Problem(loaded.gripper, target.grasps)
    simulators = Simulators(problem)
    base = fit_base(target, problem, simulators, np.random.default_rng(seed), progress, hasty)
    if lead_astray(base.fit, target):
        return fit_model(_with_own_steps(loaded, progress), seed, progress, hasty)
    target, simulators, base = _weighed(target, simulators, base)
    if not hasty:
        base = dataclasses.replace(base, fit=with_own_slopes(base.fit, target, simulators, progress))
    return target, simulators, base


def apply_model(
    loaded: Loaded[MeasurementSet], model: Model, progress: Progress, refit: bool
) -> tuple[Target, Simulators, BaseFit]:
    """Puts a model beside a set: as it is but for objects and grasps it does not know, or fitted again from there.

    Raises:
      ConfigError: if the model is of another gripper.
      PhysicsError: if it diverges.
    """
    if model.gripper.name != loaded.gripper.name:
        raise ConfigError(f"model: is of gripper {model.gripper.name}, the set is of {loaded.gripper.name}")
    target = make_target(loaded.measured, loaded.gripper)
    # rounding is not fitted: the measurements show it, and it counts as noise
    effects = [found.setting for found in model.effects if not is_rounding(found.effect)]
    problem = Problem(loaded.gripper, target.grasps, effects)
    simulators = Simulators(problem)
    vector, unknown = _coordinates(problem, model)
    if unknown.any() and not refit:
        names = ", ".join(e.name for e, u in zip(problem.entries, unknown, strict=True) if u)
        progress(f"the model does not say {names}: fitted")
    free = np.ones(len(problem), bool) if refit else unknown
    base = check_gradient(fit_once(target, problem, simulators, vector, free=free), target)
    if free.any() and lead_astray(base.fit, target):
        return apply_model(_with_own_steps(loaded, progress), model, progress, refit)
    if refit:
        return _weighed(target, simulators, base)
    _refuse_diverged(base, simulators)
    # recordings held out are judged by parameters of the others: they count as in the fit that the model is of
    weight = weights(target, base.fit.residual)
    fit = dataclasses.replace(base.fit, weight=weight)
    return dataclasses.replace(target, weight=weight), simulators, dataclasses.replace(base, fit=fit)


def _with_own_steps(loaded: Loaded[MeasurementSet], progress: Progress) -> Loaded[MeasurementSet]:
    progress("with larger physics steps some grasps go another way: fitting with the scene's own, which takes longer")
    return dataclasses.replace(loaded, gripper=with_own_steps(loaded.gripper))


def _weighed(target: Target, simulators: Simulators, base: BaseFit) -> tuple[Target, Simulators, BaseFit]:
    _refuse_diverged(base, simulators)
    weighed, fit = reweigh(target, base.fit, simulators)
    if fit is not base.fit and base.starts_agree:  # what one motion alone is missed by may not fall any further
        unfinished = base.unfinished
        base = check_gradient(fit, weighed, base.errors)
        if unfinished and not base.converged:
            base = dataclasses.replace(base, unfinished=True)
        elif not base.converged:  # slopes of what sticks and slips never vanish: does the error still fall?
            further = fit_exactly(weighed, fit.problem, simulators, fit.vector)
            if fit.cost - further.cost <= cost_tolerance(further, weighed):
                base = BaseFit(fit, base.errors, True)
    return weighed, simulators, dataclasses.replace(base, fit=fit)


def _refuse_diverged(base: BaseFit, simulators: Simulators) -> None:
    """Raises PhysicsError if the model itself diverges: there is nothing to compare."""
    if np.abs(base.fit.predicted).max() > NOWHERE / 2:
        raise PhysicsError(simulators.exact.diverged or simulators.cheap.diverged)


def _coordinates(problem: Problem, model: Model) -> tuple[np.ndarray, np.ndarray]:
    """A model's numbers as a problem's coordinates, and which of them the model does not have."""
    vector, unknown = problem.start(), np.zeros(len(problem), bool)
    for index, entry in enumerate(problem.entries):
        if entry.effect is not None:  # effects start from the model's values
            continue
        first = problem.grasps[int(np.flatnonzero(entry.members)[0])]
        places = [
            model.base,
            model.objects.get(first.object, {}),
            *(model.grasps.get(n, {}) for n in (first.name, first.session)),
        ]
        fitted = next((place[entry.parameter] for place in places if entry.parameter in place), None)
        if fitted is None:
            unknown[index] = True
        else:
            vector[index] = entry.coordinate(fitted.value)
    return vector, unknown
