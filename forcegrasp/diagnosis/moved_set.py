"""Goes on where effects leave something that the tolerance of what a set gives would explain."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Sequence

from forcegrasp.diagnosis.evidence import LEAST_LEAD, LEAST_SHARE_OF_MANY, is_beyond_chance
from forcegrasp.diagnosis.families import may_join, refit_as, refit_without
from forcegrasp.diagnosis.faults import Fault, within_tolerance
from forcegrasp.diagnosis.needless import drop_all_needless
from forcegrasp.diagnosis.result import Diagnosis, Step, kept_steps
from forcegrasp.diagnosis.study import Study
from forcegrasp.diagnosis.tolerance import all_radii
from forcegrasp.effects.object_size import ObjectSize
from forcegrasp.identify.base_fit import BaseFit
from forcegrasp.identify.cross_validation import evidence_folds
from forcegrasp.identify.fit import Fit, Simulators, fit_exactly
from forcegrasp.identify.loading import Loaded
from forcegrasp.identify.noise_floor import beyond_fit
from forcegrasp.identify.problem import Problem
from forcegrasp.identify.progress import Progress
from forcegrasp.identify.target import Target
from forcegrasp.identify.verdict import Verdict
from forcegrasp.measure import MeasurementSet

#: Searches on from a base model, a fit with effects besides, and the steps that found these.
SearchOn = Callable[[Target, Simulators, BaseFit, Fit, Sequence[Step]], Diagnosis]


def within_tolerance_after_all(found: Diagnosis, loaded: Loaded[MeasurementSet]) -> Diagnosis:
    """The diagnosis without an error of all radii that is smaller than what they are given with: it is told as moved.

    Args:
      found: of the set as it is.
      loaded: the set.
    """
    step = next((step for step in kept_steps(found.steps) if step.effects == (ObjectSize.name,)), None)
    if step is None or found.left or found.fault is not None:
        return found
    case = found.fit.problem.case(found.fit.vector)
    (move_m,) = next(one.values.tolist() for one in case.effects if one.effect.name == ObjectSize.name)
    moved = all_radii(loaded.measured, found.target, move_m)
    if moved is None:
        return found
    fault = Fault("object_tolerance", f"all radii by {1e3 * move_m:+.2g} mm", moved.check, loaded, moved)
    steps = tuple(one for one in found.steps if one is not step)
    others = tuple(name for name in found.effects if name != ObjectSize.name)
    verdict = found.verdict if others else Verdict.EXPLAINED
    return dataclasses.replace(found, verdict=verdict, effects=others, steps=steps, fault=fault)


def go_on_with_moved(
    found: Diagnosis, loaded: Loaded[MeasurementSet], search_on: SearchOn, progress: Progress
) -> tuple[Diagnosis, Simulators] | None:
    """The diagnosis of a set whose givens were moved within their tolerance; None if nothing asks for a move.

    A hidden effect hides what is a little off besides, until it is in the model. What was taken for an effect may then
    have been the objects' sizes: effects that are no longer needed are left out.

    Args:
      found: of the set as it is.
      loaded: the set.
      search_on: looks for further effects.
      progress: told what is going on.
    """
    if not found.left or loaded.gripper.is_servo or found.verdict in (Verdict.NOT_FITTED, Verdict.DATA):
        return None
    moved = _explained_by_a_move(found, loaded)
    if moved is None:
        return None
    fit, steps, fault = moved
    progress(f"fitting with {fault.words}")
    grasps = fault.put_right.measured.grasps
    target = dataclasses.replace(found.target, grasps=grasps)
    problem = Problem(loaded.gripper, grasps, fit.problem.case(fit.vector).effects)
    simulators = Simulators(problem)
    fit = fit_exactly(target, problem, simulators, fit.vector, fit.jacobian)
    study = Study(target, simulators, evidence_folds(target.grasps), beyond_fit(fit, found.numerical), progress)
    gains = study.gains(found.heldout(), study.heldout(fit))
    price = 0.0 if fault.moved is None else fault.moved.price
    if not is_beyond_chance(gains - price / len(gains), LEAST_LEAD):
        return None
    given = len(found.base.fit.problem.effects)
    steps, fit = drop_all_needless(study, steps, fit, given)
    steps, bare = _one_after_the_other(study, steps, fit)
    again = search_on(target, simulators, dataclasses.replace(found.base, fit=bare), fit, steps)
    before, after = found.error_before, again.error_before
    return dataclasses.replace(again, fault=fault, error_before=before, error_moved=after), simulators


def _explained_by_a_move(found: Diagnosis, loaded: Loaded[MeasurementSet]) -> tuple[Fit, list[Step], Fault] | None:
    """A model of which a move explains what it leaves, the steps that found its effects, and the move."""
    for fit, steps in _models(found):
        fault = within_tolerance(loaded, found.target, fit, LEAST_SHARE_OF_MANY)
        if fault is not None:
            return fit, steps, fault
    return None


def _models(found: Diagnosis) -> Iterator[tuple[Fit, list[Step]]]:
    """The final fit and its steps, and then those with a rival in the place of an effect that it can't be told from.

    An encoder's scale and objects that are all too large are nearly the same, but for what is given of each object.
    """
    steps = kept_steps(found.steps)
    yield found.fit, steps
    study = Study(found.target, Simulators(found.fit.problem), found.folds)
    for place, step in enumerate(steps):
        own, *names = step.effects
        others = [one.effect for one in found.fit.problem.effects if one.effect.name != own]
        for rival in step.candidates[1:]:
            if rival.effect.name in names and may_join(rival.effect, others):
                candidates = (rival, *(c for c in step.candidates if c is not rival))
                effects = (rival.effect.name, own, *(n for n in names if n != rival.effect.name))
                first = dataclasses.replace(step, effects=effects, candidates=candidates)
                yield refit_as(rival.setting, found.fit, own, study), [*steps[:place], first, *steps[place + 1 :]]


def _one_after_the_other(study: Study, steps: Sequence[Step], fit: Fit) -> tuple[list[Step], Fit]:
    """The steps with what each effect explains of what the move of the set leaves; and a fit without any of them.

    Args:
      study: the measurements, as moved.
      steps: that found the effects.
      fit: with all effects.
    """
    error, found = study.error(study.heldout(fit)), list(steps)
    for place, step in reversed(list(enumerate(steps))):
        if step.is_counted:
            found[place] = dataclasses.replace(step, error_before=error, error_after=error)
            continue
        setting = next(one for one in fit.effects if one.effect.name == step.effects[0])
        first = dataclasses.replace(step.candidates[0], setting=setting, fit=fit, error_after=error)
        fit, after = refit_without(step.effects[0], fit, study), error
        error = study.error(study.heldout(fit))
        candidates = (first, *step.candidates[1:])
        found[place] = dataclasses.replace(step, candidates=candidates, error_before=error, error_after=after)
    return found, fit
