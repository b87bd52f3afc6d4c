"""From a folder of measurements to a fitted model, and to where it fails."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Generic, TypeVar

import numpy as np

from forcegrasp.effects.for_gripper import effect_of
from forcegrasp.effects.quantisation import Quantisation
from forcegrasp.errors import ConfigError
from forcegrasp.identify.base_fit import BaseFit, check_gradient, fit_base
from forcegrasp.identify.comparison import Comparison
from forcegrasp.identify.cross_validation import heldout_residual, make_folds
from forcegrasp.identify.fit import Fit, Simulators, fit_once
from forcegrasp.identify.given_noise import check_given_noise
from forcegrasp.identify.intervals import intervals, standard_errors, warnings
from forcegrasp.identify.noise_floor import beyond_fit, numerical_error, numerical_floor
from forcegrasp.identify.problem import Problem
from forcegrasp.identify.target import Target, make_target
from forcegrasp.measure import FinalForceTable, MeasurementSet, check_set, check_table, read_set
from forcegrasp.models.model_file import Fitted, FoundEffect, Model
from forcegrasp.physics.gripper import Gripper
from forcegrasp.physics.gripper_file import load_gripper
from forcegrasp.short_repr import ShortRepr, counted

Progress = Callable[[str], None]


Measured = TypeVar("Measured", bound=MeasurementSet | FinalForceTable, covariant=True)


@dataclass(frozen=True, repr=False)
class Loaded(ShortRepr, Generic[Measured]):
    """A measurement set that was read and checked."""

    measured: Measured
    gripper: Gripper
    warnings: list[str]

    def summary(self) -> str:
        return f"{self.measured.summary()}; {counted(len(self.warnings), 'warning')}"


def load(path: str | Path) -> Loaded[MeasurementSet] | Loaded[FinalForceTable]:
    """Reads and checks a set.

    Raises:
      MeasurementError: if the set can't be right.
      ConfigError: if its gripper is unknown.
    """
    measured = read_set(path)
    gripper = load_gripper(measured.gripper, measured.path)
    if isinstance(measured, FinalForceTable):
        return Loaded(measured, gripper, check_table(measured, gripper.stroke))
    half_opening_m = float(gripper.opening.opening_m[-1]) / 2
    odd = check_set(measured, gripper.stroke, half_opening_m=half_opening_m, pads_at=gripper.pads_at)
    return Loaded(measured, gripper, odd + check_given_noise(measured, gripper.unit))


def fit_model(loaded: Loaded[MeasurementSet], seed: int, progress: Progress) -> tuple[Target, Simulators, BaseFit]:
    """Fits the base model to a set, from several starts."""
    target = make_target(loaded.measured, loaded.gripper)
    problem = Problem(loaded.gripper, target.grasps)
    simulators = Simulators(problem)
    return target, simulators, fit_base(target, problem, simulators, np.random.default_rng(seed), progress)


def warn_of_other_set(loaded: Loaded[MeasurementSet], model: Model, name: object) -> Loaded[MeasurementSet]:
    """The set, with a warning if a model says that it was fitted to another one; ``name`` is the model's file."""
    own = loaded.measured.fingerprint
    if model.data.get("fingerprint", own) == own:
        return loaded
    other = model.data.get("set", "a set without a name")
    warning = f"model={name}: was fitted to other measurements ({other}) than {loaded.measured.path}"
    return dataclasses.replace(loaded, warnings=[*loaded.warnings, warning])


def apply_model(
    loaded: Loaded[MeasurementSet], model: Model, progress: Progress, refit: bool
) -> tuple[Target, Simulators, BaseFit]:
    """Puts a model beside a set: as it is but for objects and grasps it does not know, or fitted again from there.

    Raises:
      ConfigError: if the model is of another gripper.
    """
    if model.gripper.name != loaded.gripper.name:
        raise ConfigError(f"model: is of gripper {model.gripper.name}, the set is of {loaded.gripper.name}")
    target = make_target(loaded.measured, loaded.gripper)
    # rounding is not fitted: the measurements show it, and it counts as noise
    effects = [(e.effect, e.variant) for e in model.effects if e.effect.name != Quantisation.name]
    problem = Problem(loaded.gripper, target.grasps, effects)
    simulators = Simulators(problem)
    vector, unknown = _coordinates(problem, model)
    if unknown.any() and not refit:
        names = ", ".join(e.name for e, u in zip(problem.entries, unknown, strict=True) if u)
        progress(f"the model does not say {names}: fitted")
    free = np.ones(len(problem), bool) if refit else unknown
    return target, simulators, check_gradient(fit_once(target, problem, simulators, vector, free=free), target)


def compare(
    loaded: Loaded[MeasurementSet], model: Model | None, seed: int, progress: Progress
) -> tuple[Comparison, Model, list[str]]:
    """Where a model fails; without one, where the base model fails after fitting it."""
    if model is None:
        target, _, base = fit_model(loaded, seed, progress)
        notes = [] if base.converged else [f"the base model is not fitted: {base.reason}"]
    else:
        target, _, base = apply_model(loaded, model, progress, refit=False)
        notes = []
    fit, same = base.fit, model is None or model.data.get("fingerprint") == loaded.measured.fingerprint
    # a model that has not seen this set is tested on all of it
    held = heldout_residual(fit, target, make_folds(target.grasps)) if same else fit.residual
    numerical = numerical_error(fit, target)
    floor = numerical_floor(beyond_fit(fit, numerical), target)
    comparison = Comparison(target, fit.predicted, fit.residual, held, floor)
    return comparison, model or model_of(fit, target, loaded, numerical), notes


def model_of(fit: Fit, target: Target, loaded: Loaded, numerical: Sequence[np.ndarray]) -> Model:
    """A fit as a model that can be written."""
    problem, errors = fit.problem, standard_errors(fit, numerical)
    base: dict[str, Fitted] = {}
    objects: dict[str, dict[str, Fitted]] = {}
    grasps: dict[str, dict[str, Fitted]] = {}
    effects: list[dict[str, Fitted]] = [{} for _ in problem.effects]
    for entry, (value, low, high) in zip(problem.entries, intervals(fit, errors), strict=True):
        fitted = Fitted(value, low, high, entry.unit)
        if entry.effect >= 0:
            effects[entry.effect][entry.parameter] = fitted
            continue
        scope = loaded.gripper.parameters[entry.parameter].scope
        first = problem.grasps[int(np.flatnonzero(entry.members)[0])]
        if scope == "gripper":
            base[entry.parameter] = fitted
        elif scope == "object":
            objects.setdefault(first.object, {})[entry.parameter] = fitted
        else:
            grasps.setdefault(first.name, {})[entry.parameter] = fitted
    found = [FoundEffect(e, v, p) for (e, v), p in zip(problem.effects, effects, strict=True)]
    if any(target.rounding):
        rounding = effect_of(Quantisation.name, loaded.gripper)
        steps = zip(rounding.parameters, target.rounding, strict=True)
        found.append(FoundEffect(rounding, "", {p.name: Fitted(s, s, s, p.unit) for p, s in steps}))
    data = {"set": loaded.measured.name, "fingerprint": loaded.measured.fingerprint}
    told = tuple(warnings(fit, errors))
    return Model(loaded.gripper, base, objects, grasps, tuple(found), data, told, _noise_of(target))


def _noise_of(target: Target) -> tuple[float, float] | None:
    """Noise of positions and forces, before rounding, for a policy to be trained with; None if it is not known."""
    kinds = [target.sensor_sigma[part] for part in (target.positions, target.forces)]
    noise = [float(np.mean(sigma)) for sigma in kinds if len(sigma) and (sigma > 0).all()]
    return (noise[0], noise[1]) if len(noise) == 2 else None


def _coordinates(problem: Problem, model: Model) -> tuple[np.ndarray, np.ndarray]:
    """A model's numbers as a problem's coordinates, and which of them the model does not have."""
    vector, unknown = problem.start(), np.zeros(len(problem), bool)
    for index, entry in enumerate(problem.entries):
        first = problem.grasps[int(np.flatnonzero(entry.members)[0])]
        if entry.effect >= 0:
            places = [e.parameters for e in model.effects if e.effect.name == problem.effects[entry.effect][0].name]
        else:
            places = [model.base, model.objects.get(first.object, {}), model.grasps.get(first.name, {})]
        fitted = next((place[entry.parameter] for place in places if entry.parameter in place), None)
        if fitted is None:
            unknown[index] = True
        else:
            vector[index] = entry.coordinate(fitted.value)
    return vector, unknown
