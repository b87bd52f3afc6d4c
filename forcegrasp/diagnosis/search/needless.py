"""Leaves out an effect that one found later made needless: the first to be found may have been its look-alike."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Collection, Sequence
from functools import partial

import numpy as np

from forcegrasp.diagnosis.evidence import LEAST_RISE, is_beyond_chance, nearly_as_much
from forcegrasp.diagnosis.families import (
    falls_back,
    fits_as_well,
    refit_as,
    refit_without,
    roughly_as,
    roughly_without,
    simpler,
)
from forcegrasp.diagnosis.result import Step, kept_steps
from forcegrasp.diagnosis.search.judge import LEAST_GAIN_AT_FLOOR, largest_fall
from forcegrasp.diagnosis.study import Study
from forcegrasp.diagnosis.verdict import LEAST_SHARE
from forcegrasp.identify.fit import Fit
from forcegrasp.identify.noise_floor import excess
from forcegrasp.identify.side_by_side import side_by_side

#: Few grasps decide if they ask so many times as clearly for an effect as is enough.
SURELY = 10.0


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
        setting=less.effects[-1],
        fit=less,
        error_after=error,
        replaces=name,
    )
    names = (last.effect.name, *(other for other in step.effects[1:] if other != last.effect.name))
    others = [c for c in step.candidates[1:] if c.effect.name != last.effect.name]
    return dataclasses.replace(step, effects=names, candidates=(last, *others), error_after=error), less


def _as_simple_as_it_is(study: Study, fit: Fit) -> Fit:
    """The fit with what its last effect contains in place of that, if it has become that without the other."""
    last = fit.effects[-1]
    for nested in last.effect.contains:
        if falls_back(fit, nested):
            simple = refit_as(simpler(last, nested, fit.problem.gripper), fit, last.effect.name, study)
            if fits_as_well(simple, fit):
                study.progress(f"{last.effect.name} is no more than {nested.effect} now")
                return simple
    return fit


def simplify(study: Study, steps: Sequence[Step], fit: Fit, given: int) -> tuple[list[Step], Fit]:
    """The steps with simpler effects in place of those that contain them, where these no longer gain more; and the fit.

    What only a richer effect has may have stood for another one that was found after it.

    Args:
      study: the measurements.
      steps: that found the effects.
      fit: with all effects.
      given: as for :func:`drop_needless`.
    """
    left = list(steps)
    for step in [step for step in steps if step.effects and step.candidates][:-1]:
        settings = {one.effect.name: one for one in fit.effects[given:]}
        known = settings.get(step.effects[0])
        if known is None:
            continue
        simple = [simpler(known, nested, fit.problem.gripper) for nested in known.effect.contains]
        roughly = [partial(roughly_as, [one], without=known.effect.name, at_the_end=False) for one in simple]
        surely = side_by_side([partial(_is_surely_worse, rough, fit, study) for rough in roughly])
        doubted = [one for one, is_more in zip(simple, surely, strict=True) if not is_more]
        if not doubted:
            continue
        without, held = study.heldout(refit_without(known.effect.name, fit, study)), study.heldout(fit)
        for nested in doubted:
            study.progress(f"fitting with {nested.effect.name} in place of {known.effect.name}")
            less = refit_as(nested, fit, known.effect.name, study)
            if is_enough(study, without, study.heldout(less), held):
                study.progress(f"{nested.effect.name} is enough")
                left[left.index(step)], fit = _with_simpler(step, nested.effect.name, less), less
                break
    return (left if left == list(steps) else chained(left, study.error(study.heldout(fit)))), fit


def _is_surely_worse(rough: Callable[..., Fit], fit: Fit, study: Study) -> bool:
    """Whether few grasps say so clearly that another model leaves more than a fit that all need not be asked.

    Args:
      rough: fits the other model roughly, from a fit and with a study.
      fit: that has what the other model lacks.
      study: the measurements.
    """
    some, part = study.on_few(fit)
    if some is study:
        return False
    less = rough(part, study=some)
    return is_beyond_chance(some.gains(less.residual, part.residual), SURELY * LEAST_RISE)


def is_enough(study: Study, without: np.ndarray, of_simple: np.ndarray, of_richer: np.ndarray) -> bool:
    """Whether a simple model does for a richer one: it gains nearly as much, and the search would not ask for the rest.

    Beside all that friction explains, say, what only the richer one explains may be little, and yet most of the rest.

    Args:
      study: the measurements.
      without: held-out residuals of the model without what the two have of their own.
      of_simple, of_richer: those that they leave.
    """
    gain, most = (float(np.nansum(study.gains(without, held))) for held in (of_simple, of_richer))
    return nearly_as_much(gain, most) and not asks_for_more(study, of_simple, of_richer, LEAST_RISE)


def asks_for_more(study: Study, of_simple: np.ndarray, of_richer: np.ndarray, least: float) -> bool:
    """Whether the search would ask for what a richer model has besides: the simple one leaves something, and more.

    Args:
      study: the measurements.
      of_simple, of_richer: residuals that they leave.
      least: of the rise of the log-likelihood.
    """
    return (
        bool(excess(of_simple, study.numerical, study.target))
        and is_beyond_chance(study.gains(of_simple, of_richer), least)
        and study.explained(of_simple, of_richer) >= LEAST_SHARE
    )


def chained(steps: Sequence[Step], error: float) -> list[Step]:
    """The steps, each of which begins with the error that the one before it leaves; the last effect leaves this one."""
    found = max(i for i, step in enumerate(steps) if step.effects)
    after = [step.error_after if i < found else error for i, step in enumerate(steps)]
    before = [steps[0].error_before, *after]
    return [
        dataclasses.replace(s, error_before=b, error_after=a) for s, b, a in zip(steps, before, after, strict=False)
    ]


def _with_simpler(step: Step, name: str, fit: Fit) -> Step:
    """A step that found this effect, which is the last of a fit, in place of one that contains it."""
    tried = next((c for c in step.candidates if c.effect.name == name), step.candidates[0])
    first = dataclasses.replace(tried, setting=fit.effects[-1])
    others = [c for c in step.candidates if c is not tried]
    names = (name, *(n for n in step.effects[1:] if n != name))
    return dataclasses.replace(step, effects=names, candidates=(first, *others), error_after=tried.error_after)


def drop_all_needless(
    study: Study, steps: Sequence[Step], fit: Fit, given: int, of: Collection[str] | None = None
) -> tuple[list[Step], Fit]:
    """The steps whose effects held-out grasps still ask for, and the fit without the others.

    Args:
      study: the measurements.
      steps: that found the effects.
      fit: with all effects.
      given: as for :func:`drop_needless`.
      of: names of the effects that are doubted; all by default.
    """
    left = list(steps)
    while found := _without_needless(
        study, fit, [one.effect.name for one in fit.problem.effects[given:] if of is None or one.effect.name in of]
    ):
        name, fit = found
        study.progress(f"{name} is needless now")
        left = [step for step in left if name not in step.effects[:1]]
    return left, fit


def drop_needless_of_many(study: Study, steps: Sequence[Step], fit: Fit, given: int) -> tuple[list[Step], Fit]:
    """The same of the effects that were found at once: each was needed beside the others as they were then.

    The steps lead from the first error to the last; nothing is left out where that would leave no step.
    """
    at_once = {s.effects[0] for s in kept_steps(steps) if s.candidates and s.candidates[0].without is not None}
    left, less = drop_all_needless(study, steps, fit, given, at_once) if at_once else (list(steps), fit)
    if less is fit or not kept_steps(left):
        return list(steps), fit
    left[0] = dataclasses.replace(left[0], error_before=steps[0].error_before)
    return chained(left, study.error(study.heldout(less))), less


def _without_needless(study: Study, fit: Fit, names: Sequence[str]) -> tuple[str, Fit] | None:
    """That one of these effects which held-out grasps ask for least, if they don't, and the fit without it."""
    held, without = study.heldout(fit), {}
    rough = partial(roughly_without, at_the_end=False)
    surely = side_by_side([partial(_is_surely_worse, partial(rough, name), fit, study) for name in names])
    doubted = [name for name, is_needed in zip(names, surely, strict=True) if not is_needed]
    for name in doubted:
        study.progress(f"fitting without {name}")
    fits = side_by_side([partial(refit_without, name, fit, study) for name in doubted])
    for name, less in zip(doubted, fits, strict=True):
        if not _is_asked_for(study, study.heldout(less), held):
            without[name] = less
    return min(without.items(), key=lambda item: item[1].cost) if without else None


def _is_asked_for(study: Study, without: np.ndarray, held: np.ndarray) -> bool:
    """Whether held-out residuals without an effect ask for it: it would be looked for, and found, beside the others."""
    if not is_beyond_chance(study.gains(without, held), LEAST_RISE):
        return False
    leaves_more = excess(without, study.numerical, study.target)
    return bool(leaves_more) or largest_fall(study.target, without, held) >= LEAST_GAIN_AT_FLOOR
