"""What the verbs do: compare, fit, diagnose and add, from a folder of measurements to a result."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Generic, TypeVar

import numpy as np

from forcegrasp.compare.base_fit import BaseFit, check_gradient, fit_base
from forcegrasp.compare.comparison import Comparison
from forcegrasp.compare.diagnose import Diagnosis, diagnose
from forcegrasp.compare.fit import Fit, Simulators, fit_exactly, fit_once
from forcegrasp.compare.floor import beyond_fit, numerical_error, numerical_floor
from forcegrasp.compare.given_noise import check_given_noise
from forcegrasp.compare.heldout import heldout_residual, make_folds, rms
from forcegrasp.compare.intervals import intervals, standard_errors, warnings
from forcegrasp.compare.problem import Problem
from forcegrasp.compare.refine import refine
from forcegrasp.compare.score import Background, Signatures
from forcegrasp.compare.target import Target, make_target
from forcegrasp.effects import Effect
from forcegrasp.effects.for_gripper import effect_of, effects_of
from forcegrasp.effects.model_file import Fitted, FoundEffect, Model
from forcegrasp.effects.quantisation import Quantisation
from forcegrasp.errors import ConfigError, MeasurementError
from forcegrasp.measure import FinalForceTable, MeasurementSet, check_set, check_table, read_set
from forcegrasp.physics.gripper import Gripper
from forcegrasp.physics.gripper_file import load_gripper
from forcegrasp.short_repr import ShortRepr, counted

#: A diagnosis needs so many grasps: with fewer, nothing can be held out.
LEAST_GRASPS = 6

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
    odd = check_set(measured, gripper.stroke, half_opening_m=float(gripper.opening.opening_m[-1]) / 2)
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


def diagnose_set(
    loaded: Loaded[MeasurementSet], model: Model | None, names: list[str], seed: int, progress: Progress
) -> tuple[Diagnosis, Simulators]:
    """Which effects are missing.

    Raises:
      MeasurementError: if there are too few grasps to hold any out.
      ConfigError: if an effect is unknown, or can't show on this gripper.
    """
    if len(loaded.measured.grasps) < LEAST_GRASPS:
        raise MeasurementError(
            f"{loaded.measured.path}: {len(loaded.measured.grasps)} grasps are too few for a diagnosis,"
            f" {LEAST_GRASPS} are needed; record more (forcegrasp record shows a plan)"
        )
    if model is None:
        target, simulators, base = fit_model(loaded, seed, progress)
    else:
        target, simulators, base = apply_model(loaded, model, progress, refit=True)
    chosen = chosen_effects(loaded.gripper, names)
    rng = np.random.default_rng(seed + 1)
    return diagnose(target, base, simulators, chosen, rng, progress), simulators


def chosen_effects(gripper: Gripper, names: Sequence[str]) -> list[type[Effect]]:
    """The effects of these names as a gripper has them, in the order in which they act; without names all.

    Raises:
      ConfigError: if one is unknown, or can't show on this gripper.
    """
    wanted = {effect_of(name, gripper).name for name in names}
    return [effect for name, effect in effects_of(gripper).items() if not names or name in wanted]


@dataclass(frozen=True, repr=False)
class Added(ShortRepr):
    """A model with an effect added, against the same model without it."""

    target: Target
    before: Fit
    after: Fit
    error_before: float  #: held-out rms residual ÷ noise
    error_after: float
    model: Model

    def summary(self) -> str:
        return f"error {self.error_before:.2f} → {self.error_after:.2f} × noise, {self.model!r}"


def add_effect(loaded: Loaded[MeasurementSet], model: Model, effect: type[Effect], progress: Progress) -> Added:
    """Fits a model again, without and with one more effect.

    Raises:
      ConfigError: if the model has the effect, or the effect leaves no trace in these data.
    """
    if any(e.effect.name == effect.name for e in model.effects):
        raise ConfigError(f"effect={effect.name}: the model has it already")
    target, simulators, base = apply_model(loaded, model, progress, refit=True)
    before, folds = base.fit, make_folds(target.grasps)
    progress(
        f"without {effect.name}: {rms(heldout_residual(before, target, folds), target):.3f} × noise on held-out grasps"
    )
    if effect.name == Quantisation.name and any(target.rounding):  # it is in the noise already
        coarse = target.sigma / target.sensor_sigma
        held = heldout_residual(before, target, folds)
        same = model_of(before, target, loaded, numerical_error(before, target))
        return Added(target, before, before, rms(held * coarse, target), rms(held, target), same)
    background, signatures = Background(before, []), Signatures([effect], target, simulators)
    signatures.simulate(before, [effect])
    scores = [group[0] for group in signatures.scores(before, background, [effect])]
    if not scores:
        raise ConfigError(
            f"effect={effect.name}: leaves no trace in these data at any size; record grasps that show it"
        )
    refined = refine(scores, target, before, simulators, background)
    nearest = min((r.fit for r in refined), key=lambda f: f.cost)
    after = fit_exactly(target, nearest.problem, simulators, nearest.vector)
    error_before, error_after = (rms(heldout_residual(f, target, folds), target) for f in (before, after))
    better = model_of(after, target, loaded, numerical_error(after, target))
    return Added(target, before, after, error_before, error_after, better)


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
