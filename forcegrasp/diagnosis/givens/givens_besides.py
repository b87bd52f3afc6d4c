"""Puts right what a set gives and is seen to be wrong only once the effects are known that had hidden it."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Sequence

from forcegrasp.diagnosis.families import may_join, refit_as
from forcegrasp.diagnosis.faults.fault import Fault
from forcegrasp.diagnosis.faults.suspects import suspects
from forcegrasp.diagnosis.few import with_few
from forcegrasp.diagnosis.givens.doubt import with_fault
from forcegrasp.diagnosis.givens.moved_set import SearchOn, one_after_the_other
from forcegrasp.diagnosis.result import Diagnosis, Step, kept_steps
from forcegrasp.diagnosis.study import Study
from forcegrasp.diagnosis.verdict import MUCH
from forcegrasp.identify.base_fit import BaseFit
from forcegrasp.identify.cross_validation import evidence_folds
from forcegrasp.identify.fit import Fit
from forcegrasp.identify.loading import Loaded
from forcegrasp.identify.noise_floor import beyond_fit
from forcegrasp.identify.progress import Progress
from forcegrasp.identify.simulators import Simulators
from forcegrasp.identify.target import Target
from forcegrasp.measure import MeasurementSet

#: A set lined up, what simulates its grasps, and a model that was fitted to it.
Fitted = tuple[Target, Simulators, BaseFit]
#: Fits a model with the effects that were found to the set put right; None unless that leaves much less.
PutRight = Callable[[Fault, Fitted], tuple[Fault, Fitted] | None]
# So many rivals are tried, of those that explained this share of what the effects did that were found.
_RIVALS, _NEARLY = 2, 0.8


def with_givens_put_right(
    found: Diagnosis, loaded: Loaded[MeasurementSet], put_right: PutRight, search_on: SearchOn, progress: Progress,
    least: float = MUCH,
) -> tuple[Diagnosis, Simulators] | None:  # fmt: skip
    """The diagnosis with radii, or a recording's setting, put right beside effects; None if little is left, or a tie.

    Args:
      found: of the set as it is.
      loaded: the set.
      put_right: fits the effects that were found to the set without the fault.
      search_on: looks for further effects.
      progress: told what is going on.
      least: error ÷ floor from which on it is asked.
    """
    steps = kept_steps(found.steps)
    plain = bool(steps) and all(len(step.effects) == 1 and step.candidates for step in steps)
    little = not found.left or found.error_after < least * found.floor
    if not plain or little or found.fault is not None or found.stopped:
        return None
    tried: list[tuple[Fault, Fitted, list[Step]]] = []
    for model, of_model in _near_models(found, steps, progress):
        said = found.target, Simulators(model.problem), dataclasses.replace(found.base, fit=model)
        for fault in suspects(loaded, found.target, model):
            if fault.fitted and (better := put_right(fault, said)) is not None:
                tried.append((*better, of_model))
                break
    for fault, (target, simulators, base), of_model in sorted(tried, key=lambda one: one[1][2].fit.cost):
        numerical = beyond_fit(base.fit, found.numerical)
        study = with_few(Study(target, simulators, evidence_folds(target.grasps), numerical, progress), base.fit)
        first = [dataclasses.replace(step, candidates=step.candidates[:1]) for step in of_model]
        first, bare = one_after_the_other(study, first, base.fit)
        again = search_on(target, simulators, dataclasses.replace(base, fit=bare), base.fit, first)
        if fault.is_borne_out(again.fit):
            return with_fault(again, fault.told_by(again.fit), (found.target, found.base.fit)), simulators
    return None


def _near_models(found: Diagnosis, steps: Sequence[Step], progress: Progress) -> Iterator[tuple[Fit, list[Step]]]:
    """The final fit, and fits with rivals that explained nearly as much in the place of effects; each with its steps.

    Of an encoder and a motor that are off by a constant the wrong one may explain more while radii are wrong.
    """
    yield found.fit, list(steps)
    study = Study(found.target, Simulators(found.fit.problem), found.folds)
    known = [one.effect for one in found.fit.problem.effects]
    near = [
        (place, rival)
        for place, step in enumerate(steps)
        for rival in step.candidates[1:]
        if rival.heldout_gain > _NEARLY * step.candidates[0].heldout_gain
        and not (rival.effect.of_set or rival.replaces)
        and may_join(rival.effect, [effect for effect in known if effect.name != step.effects[0]])
    ]
    for place, rival in near[:_RIVALS]:
        name = steps[place].effects[0]
        progress(f"trying {rival.effect.name} in place of {name} with what the set gives put right")
        fit = refit_as(rival.setting, found.fit, name, study)
        own = dataclasses.replace(rival, setting=fit.effect(rival.effect.name), fit=fit)
        first = dataclasses.replace(steps[place], effects=(rival.effect.name,), candidates=(own,))
        yield fit, [*steps[:place], first, *steps[place + 1 :]]
