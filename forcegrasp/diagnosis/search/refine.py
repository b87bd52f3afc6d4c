"""Fits everything again with one more effect, from where its signature puts it, or whatever that promises."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from forcegrasp.diagnosis.families import is_richer, roughly_as
from forcegrasp.diagnosis.signatures import Background, Score, best_sizes, trials, trials_of
from forcegrasp.diagnosis.study import Study
from forcegrasp.effects import Effect
from forcegrasp.effects.setting import EffectSetting
from forcegrasp.identify.base_fit import rms_error
from forcegrasp.identify.fit import Fit, fit_once
from forcegrasp.identify.predict import Case, predict
from forcegrasp.identify.problem import Problem
from forcegrasp.identify.side_by_side import side_by_side
from forcegrasp.short_repr import ShortRepr

# At its best size an effect promises nearly what a fit will gain: one with less than this share of the best has lost.
_LOST = 0.4
#: The same of what effects gain that are fitted, to few grasps or roughly.
LOST_IF_FITTED = 0.7
#: A rough fit whose cost is no smaller share of another's is no better; rough ones end within a tenth of that.
NO_BETTER = 0.99
#: On few grasps an effect may leave so many times as much as the one in whose place it is, and yet do as well on all.
AS_GOOD = 1.02
# Beyond so many times the noise base parameters may be far from where they are with the effect that is missing.
_MADE_UP = 3.0


@dataclass(frozen=True, eq=False, repr=False)
class Refined(ShortRepr):
    """A rough fit with one more effect."""

    score: Score  #: the signature that it started from
    fit: Fit


def refine(scores: Sequence[Score], study: Study, fit: Fit, background: Background) -> list[Refined]:
    """Fits with each effect that may still be the best one; those that promise most come first.

    Few grasps lead most of the way, and most effects have lost there.

    Args:
      scores: the best signature of each effect or variant.
      study: the measurements.
      fit: of the model without these effects.
      background: what gets no credit.
    """
    sized = best_sizes(scores, study, fit, background)
    # one grasp in which something else happens at this size, which a fit would mend, must not rule an effect out
    racing = {*_in_the_race([one.gain for one, _ in sized], _LOST), *_in_the_race([few for _, few in sized], _LOST)}
    pairs = sorted(((sized[i][0], scores[i]) for i in racing), key=lambda pair: -pair[0].gain)
    some, part = study.on_few(fit)
    settings = [sized.setting for sized, _ in pairs]
    where = f"on {len(some.target.grasps)} grasps"
    if settings:
        study.progress(f"fitting each of {len(settings)} effects and variants, {where}")
    tasks = [partial(fit_with, [setting], part.vector, some, part) for setting in settings]
    fits = side_by_side(
        [some.telling(f"{one.title}, {where}", task, part) for one, task in zip(settings, tasks, strict=True)]
    )
    stalled = [i for i, one in enumerate(fits) if one.cost > part.cost]  # a size too far off for slopes to lead back
    tasks = [partial(roughly_as, trials_of(*settings[i].kind), part, (), some) for i in stalled]
    for i, again in zip(stalled, side_by_side(tasks), strict=True):
        fits[i] = min(fits[i], again, key=lambda one: one.cost)
    if some is study:
        return [Refined(score, one) for (_, score), one in zip(pairs, fits, strict=True)]
    racing = _in_the_race([part.cost - one.cost for one in fits], LOST_IF_FITTED)
    left = [i for i in racing if not _adds_nothing(fits[i], fits)]
    tasks = []
    for few in (fits[i] for i in left):
        setting = few.effects[-1]
        start = fit.moved(part.problem, few.vector[: len(part.problem)])
        task = partial(fit_with, [setting], start, study, fit)
        tasks.append(study.telling(f"{setting.title}, on all grasps", task, fit))
    return [Refined(pairs[i][1], refitted) for i, refitted in zip(left, side_by_side(tasks), strict=True)]


def refine_anyway(
    effects: Sequence[type[Effect]], study: Study, fit: Fit, without: str | tuple[()] = (), most: float = NO_BETTER
) -> list[Fit]:
    """Rough fits with each effect that may be the best one, of those that leave less than a fit does on few grasps.

    They start from the best of the sizes that are tried, and nothing is asked of signatures. Where much is left they
    start from base parameters as given, too.

    Args:
      effects: that are added.
      study: the measurements.
      fit: of the model that they are added to.
      without: name of an effect in it whose place they take; none by default.
      most: share of what the fit leaves that one may leave on few grasps.
    """
    some, part = study.on_few(fit)
    rough = partial(roughly_as, fit=part, without=without, study=some, at_the_end=some is study)
    where = "on all grasps" if some is study else f"on {len(some.target.grasps)} grasps"
    few = side_by_side([some.telling(f"{e.name}, {where}", partial(rough, trials([e])), part) for e in effects])
    elsewhere: list[Fit] = []
    if not without and rms_error(part, some.target) > _MADE_UP:
        elsewhere = side_by_side([partial(rough, trials([effect]), begin=as_given(part)) for effect in effects])
        few = [min(pair, key=lambda one: one.cost) for pair in zip(few, elsewhere, strict=True)]
    few = [one for one in few if one.cost < most * part.cost]
    if some is study:
        return few
    tasks = []
    for index in _in_the_race([part.cost - one.cost for one in few], LOST_IF_FITTED):
        one, setting = few[index], few[index].effects[-1]
        begin = fit.moved(part.problem, one.vector[: len(part.problem)]) if one in elsewhere else None
        task = partial(roughly_as, [setting], fit, without, study, begin=begin)
        tasks.append(study.telling(f"{setting.title}, on all grasps", task, fit))
    return side_by_side(tasks)


def best_as_given(effects: Sequence[type[Effect]], study: Study, fit: Fit, most: int) -> list[type[Effect]]:
    """So many of the effects at most, those that leave least of few grasps beside base parameters as given, unfitted.

    Where the base fit has made up for one, signatures there say nothing of it. None where little is left.
    """
    some, part = study.on_few(fit)
    if rms_error(part, some.target) <= _MADE_UP:
        return []
    tried, begun = trials(effects), part.problem.case(as_given(part))
    cases = [Case(begun.base, (*begun.effects, one)) for one in tried]
    left = map(some.target.residual, predict(some.rough or some.simulators.cheap, cases))
    costs: dict[type[Effect], float] = {}
    for one, residual in zip(tried, left, strict=True):
        cost = float(np.sum((part.weight * residual) ** 2))
        costs[one.effect] = min(cost, costs.get(one.effect, np.inf))
    return sorted(costs, key=lambda effect: costs[effect])[:most]


def as_given(fit: Fit) -> np.ndarray:
    """A fit's coordinates with base parameters as the description has them, ``(p,)``; objects stay where they are."""
    problem = fit.problem
    base = [e.effect is None and e.parameter not in ("radius_m", "offset_m") for e in problem.entries]
    return np.where(base, problem.start(), fit.vector)


def _in_the_race(gains: Sequence[float], least: float) -> list[int]:
    """Indices of the gains that are no less than this share of the best; not of those that are not known."""
    best = max((gain for gain in gains if np.isfinite(gain)), default=np.inf)
    return [i for i, gain in enumerate(gains) if gain >= min(best, least * best)]


def _adds_nothing(fit: Fit, others: Sequence[Fit]) -> bool:
    """Whether an effect, the last of a fit, leaves as much as one that it contains; it may take its place later."""
    own = fit.problem.effects[-1].effect
    return any(is_richer(own, one.problem.effects[-1].effect) and NO_BETTER * one.cost < fit.cost for one in others)


def fit_with(settings: Sequence[EffectSetting], start: np.ndarray, study: Study, fit: Fit) -> Fit:
    """A rough fit with more effects.

    Args:
      settings: the effects, as they start.
      start: coordinates of the others, ``(p,)``.
      study: the measurements.
      fit: without these effects; its slopes are kept.
    """
    old = fit.problem
    problem = Problem(old.gripper, old.grasps, [*old.effects, *settings])
    start = np.r_[start, problem.start()[len(old) :]]
    return fit_once(study.target, problem, study.simulators, start, fit.correction, rounds=0, known_slopes=fit.jacobian)
