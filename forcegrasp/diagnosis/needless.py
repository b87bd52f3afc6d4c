"""Leaves out an effect that one found later made needless: the first to be found may have been its look-alike."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

from forcegrasp.diagnosis.evidence import LEAST_RISE, is_beyond_chance
from forcegrasp.diagnosis.families import falls_back, refit_as, refit_without, roughly_without, simpler, stalled
from forcegrasp.diagnosis.result import Step
from forcegrasp.diagnosis.study import Study
from forcegrasp.identify.fit import Fit

# Few grasps decide if they ask so many times as clearly for an effect as is enough.
_SURELY = 10.0


def drop_needless(study: Study, step: Step, fit: Fit, given: int) -> tuple[Step, Fit]:
    """The step, whose effect takes the place of an earlier one if held-out grasps no longer ask for that.

    Args:
      study: the measurements.
      step: that found the last effect of the fit.
      fit: with all effects.
      given: number of effects that were in the model before the search; they stay.
    """
    names = [one.effect.name for one in fit.problem.effects[given:-1]]
    found = None if step.replaces else _without_needless(study, fit, names)  # a step takes the place of one at most
    if found is None:
        return step, fit
    name, less = found
    study.progress(f"{name} is needless with {step.effects[0]}")
    less = _as_simple_as_it_is(study, less)
    error = study.error(study.heldout(less))
    last = dataclasses.replace(
        step.candidates[0],
        setting=less.problem.case(less.vector).effects[-1],
        fit=less,
        error_after=error,
        replaces=name,
    )
    names = (last.effect.name, *(other for other in step.effects[1:] if other != last.effect.name))
    others = [c for c in step.candidates[1:] if c.effect.name != last.effect.name]
    return dataclasses.replace(step, effects=names, candidates=(last, *others), error_after=error), less


def _as_simple_as_it_is(study: Study, fit: Fit) -> Fit:
    """The fit with what its last effect contains in place of that, if it has become that without the other."""
    last = fit.problem.case(fit.vector).effects[-1]
    for nested in last.effect.contains:
        if falls_back(fit, nested):
            simple = refit_as(simpler(last, nested, fit.problem.gripper), fit, last.effect.name, study)
            if not stalled(simple, fit):
                study.progress(f"{last.effect.name} is no more than {nested.effect} now")
                return simple
    return fit


def drop_all_needless(study: Study, steps: Sequence[Step], fit: Fit, given: int) -> tuple[list[Step], Fit]:
    """The steps whose effects held-out grasps still ask for, and the fit without the others.

    Args:
      study: the measurements.
      steps: that found the effects.
      fit: with all effects.
      given: as for :func:`drop_needless`.
    """
    left = list(steps)
    while found := _without_needless(study, fit, [one.effect.name for one in fit.problem.effects[given:]]):
        name, fit = found
        study.progress(f"{name} is needless now")
        left = [step for step in left if name not in step.effects[:1]]
    return left, fit


def _is_surely_needed(name: str, fit: Fit, study: Study) -> bool:
    """Whether few grasps say so clearly that the model needs an effect that all need not be asked."""
    some, part = study.on_few(fit)
    less = None if some is study else roughly_without(name, part, some)
    return less is not None and is_beyond_chance(some.gains(less.residual, part.residual), _SURELY * LEAST_RISE)


def _without_needless(study: Study, fit: Fit, names: Sequence[str]) -> tuple[str, Fit] | None:
    """That one of these effects which held-out grasps ask for least, if they don't, and the fit without it."""
    held, without = study.heldout(fit), {}
    for name in names:
        if _is_surely_needed(name, fit, study):
            continue
        study.progress(f"fitting without {name}")
        less = refit_without(name, fit, study)
        if not is_beyond_chance(study.gains(study.heldout(less), held), LEAST_RISE):
            without[name] = less
    return min(without.items(), key=lambda item: item[1].cost) if without else None
