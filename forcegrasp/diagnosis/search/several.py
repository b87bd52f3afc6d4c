"""Adds several effects at once, where none stands out: alone each explains little, and makes up for the others.

The signatures that fit best beside each other are chosen, their effects are fitted together, those that others make
needless are left out, and what is left then is asked again.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from forcegrasp.diagnosis.evidence import LEAST_RISE, LEAST_SHARE_OF_MANY, is_beyond_chance
from forcegrasp.diagnosis.families import look_alikes_of, may_join, problem_without, roughly_as
from forcegrasp.diagnosis.few import with_few
from forcegrasp.diagnosis.result import Step
from forcegrasp.diagnosis.search.forms import done_by_each
from forcegrasp.diagnosis.search.judge import judged
from forcegrasp.diagnosis.search.left_over import is_worth_looking
from forcegrasp.diagnosis.search.needless import chained
from forcegrasp.diagnosis.search.refine import NO_BETTER, fit_with, refine
from forcegrasp.diagnosis.search.screen import MAX_GAIN_FACTOR, Screen
from forcegrasp.diagnosis.signatures import (
    Background,
    Score,
    chance_of,
    direction,
    null_gains,
    of_best_effects,
    trials,
)
from forcegrasp.diagnosis.study import Study
from forcegrasp.diagnosis.verdict import EXPLAINED, LEAST_SHARE
from forcegrasp.effects import Effect
from forcegrasp.effects.setting import EffectSetting
from forcegrasp.identify.fit import Fit, fit_exactly, fit_once
from forcegrasp.identify.problem import Problem
from forcegrasp.identify.side_by_side import side_by_side

#: Told the steps that were found so far, and the fit with their effects; whether that is all there is to find.
Keep = Callable[[list[Step], Fit], bool]
# So many effects at a time, in so many rounds; each is to explain this share of the squares beyond the noise.
_AT_ONCE, _ROUNDS, _LEAST = 5, 6, 0.02
# One effect alone is not several: that one is looked for by itself.
_SEVERAL = 2
# Slopes are measured anew where a fit by those of its start came to this share of the cost there.
_WELL_BELOW = 0.8
# Directions whose slopes are a smaller share of the steepest one's are left alone.
_FLAT = 1e-2
# One of them stands out, if it promises this share of what they promise together.
_STANDS_OUT = 0.5
# Effects add up if they promise this share of the squares beyond the noise together: their signatures are straight, and
# so are they. They are several if none promises more than so much of what all do.
_NEARLY_ALL, _ONE_ALONE = 0.75, 0.9
# Each of them is to be worth this share of the squares beyond the noise, or such a share of those of the noise.
_WORTH, _OF_NOISE = 0.01, 0.05


def none_stands_out(study: Study, fit: Fit, screen: Screen, effects: Sequence[type[Effect]]) -> bool:
    """Whether signatures promise that several effects explain together what none explains alone.

    Args:
      study: the measurements.
      fit: with the effects that were found so far.
      screen: of the catalogue.
      effects: those that are not in the model.
    """
    gains = [score.gain for score in _chosen(study, fit, screen, effects)]
    return len(gains) > 1 and gains[0] < _STANDS_OUT * sum(gains)


def add_up(study: Study, fit: Fit, screen: Screen, effects: Sequence[type[Effect]]) -> bool:
    """Whether signatures of several effects, one added to the other, explain nearly all that a fit leaves.

    Args:
      study, fit, screen, effects: as for :func:`none_stands_out`.
    """
    some, part = study.on_few(fit)
    gains = [score.gain for score in _chosen(study, fit, screen, effects, of_set=True)]
    together, beyond = sum(gains), some.target.beyond_noise(part.residual)
    return len(gains) > 1 and together > _NEARLY_ALL * beyond and gains[0] < _ONE_ALONE * together


def most_gained_by_one(
    study: Study, fit: Fit, screen: Screen, effects: Sequence[type[Effect]], least: float = 0.0
) -> float:
    """Squares that one effect alone gains on few grasps, fitted to them: large ones bend.

    Args:
      study, fit, screen, effects: as for :func:`none_stands_out`.
      least: what is asked for; effects whose signatures promise too little for that are not fitted.
    """
    some, part = study.on_few(fit)
    groups, _ = screen.on_few(study, some, part, effects)
    promising = [group[0] for group in groups if group[0].gain > MAX_GAIN_FACTOR * least]
    best = of_best_effects(sorted(promising, key=lambda score: -score.gain), _AT_ONCE)
    alone = refine(best, some, part, Background(part, some.numerical))
    return max((part.cost - one.fit.cost for one in alone), default=0.0)


def usual_on_few(study: Study, fit: Fit) -> float:
    """Squares beyond the noise that as many grasps as the few leave on average.

    The few show more than others, and where one reading is far off by a heavy tail of the noise, much more.
    """
    some, _ = study.on_few(fit)
    return max(study.target.beyond_noise(fit.residual), 0.0) * some.target.readings / study.target.readings


def share_of_one(study: Study, fit: Fit, screen: Screen, effects: Sequence[type[Effect]]) -> float:
    """The same gain as a share of the squares that few grasps leave beyond the noise."""
    some, part = study.on_few(fit)
    return most_gained_by_one(study, fit, screen, effects) / max(some.target.beyond_noise(part.residual), 1e-9)


def share_of_alike(
    study: Study, fit: Fit, screen: Screen, effects: Sequence[type[Effect]]
) -> dict[type[Effect], float]:
    """The same of the effect whose signature promises most, and of all that look like it, whatever they promise.

    One that bends with its size, or that moves base parameters far, gains more than its signature says.
    """
    some, part = study.on_few(fit)
    best = [score.setting.effect for score in _chosen(study, fit, screen, effects)[:1]]
    alike = [*best, *(other for own in best for other in look_alikes_of(own, effects, of_any_family=True))]
    fits = side_by_side([partial(roughly_as, trials([e]), part, (), some, at_the_end=False) for e in alike])
    beyond = max(some.target.beyond_noise(part.residual), 1e-9)
    return {e: max((part.cost - one.cost) / beyond, 0.0) for e, one in zip(alike, fits, strict=True)}


def share_of_all(study: Study, fit: Fit, further: Fit) -> float:
    """The same share that all effects gain which a further fit has."""
    (some, part), (_, several) = study.on_few(fit), study.on_few(further)
    return (part.cost - several.cost) / max(some.target.beyond_noise(part.residual), 1e-9)


def add_several(
    study: Study, fit: Fit, steps: Sequence[Step], effects: Sequence[type[Effect]], given: int,
    rng: np.random.Generator, keep: Keep, straight: Screen | None = None,
) -> tuple[list[Step], Fit] | None:  # fmt: skip
    """Steps that found effects together, after those that found others, and the fit with all; None if none are found.

    What the error falls by all together is shared out among the steps by what leaving out each effect costs.

    Args:
      study: the measurements.
      fit: with the effects that were found so far.
      steps: that found them.
      effects: the catalogue.
      given: number of effects that were in the model before the search; they stay.
      rng: for the null distribution.
      keep: told what each round has found, which is all there is if no other one ends, or if it says so.
      straight: signatures of those that :func:`add_up`, to begin with: then mistakes of the set are among them, which
        else may look like anything, and what explains next to nothing is not.
    """
    before, barred = fit, set[str]()
    for _ in range(_ROUNDS):
        study = with_few(study, fit)
        known = [one.effect for one in fit.problem.effects]
        untried = [e for e in effects if e.name not in barred and may_join(e, known)]
        screen = straight if straight is not None and fit is before else Screen(effects, study)
        chosen = [one.setting for one in _chosen(study, fit, screen, untried, of_set=straight is not None)]
        if len(chosen) < (_SEVERAL if fit is before else 1):
            break
        study.progress(f"fitting together {', '.join(one.effect.name for one in chosen)}")
        further, needless = _without_needless(study, _fitted_together(chosen, study, fit), given)
        barred.update(needless)  # it promises what no fit keeps, and would promise it again
        if not (names := [name for name in _names(further) if name not in _names(fit)]):
            continue
        held, after = study.heldout(fit), study.heldout(further)
        # the first five together explain little only where they are look-alikes of what is not known
        further_on = LEAST_SHARE_OF_MANY if straight is None else LEAST_SHARE  # one by one as much is asked for
        if study.explained(held, after) < (EXPLAINED if fit is before else further_on):
            break
        change = f"{study.error(held):.2f} → {study.error(after):.2f} × noise"
        study.progress(f"found {', '.join(names)}: held-out error {change}")
        fit = further
        if keep(_steps(study, steps, before, fit, rng, in_a_hurry=True), fit) or not is_worth_looking(study, fit):
            break
    if fit is not before:
        target = study.target
        worth = min(_WORTH * target.beyond_noise(before.residual), _OF_NOISE * target.cost_of_noise)
        fit = _needed(study, _in_best_variants(study, fit, before), given, 0.0 if straight is None else worth)
    if set(_names(fit)) <= set(_names(before)):
        return None
    fit = _at_the_end(study, fit)
    return _steps(study, steps, before, fit, rng), fit


def _chosen(
    study: Study, fit: Fit, screen: Screen, effects: Sequence[type[Effect]], of_set: bool = False
) -> list[Score]:
    """Signatures that are worth a fit together, with or without those of mistakes of the set."""
    tried = [e for e in effects if of_set or not e.of_set]
    return screen.one_after_the_other(study, fit, tried, _AT_ONCE, _LEAST)


def _names(fit: Fit) -> list[str]:
    return [one.effect.name for one in fit.problem.effects]


def _fitted_together(settings: Sequence[EffectSetting], study: Study, fit: Fit) -> Fit:
    """A rough fit with all of these effects besides, from where few grasps lead.

    Slopes are measured once or twice, and kept in between: with a dozen effects they take most of the time.
    """
    some, part = study.on_few(fit)
    few = fit_with(settings, part.vector, some, part)
    old, new = np.split(few.vector, [len(part.problem)])
    problem = Problem(fit.problem.gripper, fit.problem.grasps, [*fit.problem.effects, *few.effects[-len(settings) :]])
    roughly = partial(fit_once, study.target, problem, study.simulators, correction=fit.correction, rounds=0)
    start = roughly(np.r_[fit.moved(part.problem, old), new], free=np.zeros(len(problem), bool))
    further = roughly(start.vector, known_slopes=start.jacobian)
    if further.cost < _WELL_BELOW * start.cost:
        start = roughly(further.vector, free=np.zeros(len(problem), bool))
        further = roughly(start.vector, known_slopes=start.jacobian)
    return further


def _without_needless(study: Study, fit: Fit, given: int) -> tuple[Fit, list[str]]:
    """The fit without the effects whose absence costs next to nothing, and their names."""
    needless: list[str] = []
    while len(fit.problem.effects) > given:
        some, part = study.on_few(fit)
        costs = _costs_of_absence(some, part)[given:]
        least = int(np.argmin(costs))
        if costs[least] > _LEAST * some.target.beyond_noise(part.residual):
            break
        name = _names(fit)[given + least]
        study.progress(f"{name} is needless beside the others")
        needless.append(name)
        fit = _without(name, study, fit)
    return fit, needless


def _in_best_variants(study: Study, fit: Fit, before: Fit) -> Fit:
    """A fit with the effects that it has besides in the variants that leave least: signatures had chosen these."""
    for name in [name for name in _names(fit) if name not in _names(before)]:
        some, part = study.on_few(fit)
        own = fit.effect(name)
        others = [one for one in trials([own.effect]) if one.variant != own.variant]
        best = roughly_as(others, part, name, some, at_the_end=False) if others else part
        if best.cost < NO_BETTER * part.cost:
            fit = roughly_as([best.effects[-1]], fit, name, study)
    return fit


def _without(name: str, study: Study, fit: Fit) -> Fit:
    """A rough fit that lacks an effect, by the slopes that there are: to measure those of all others takes long."""
    problem, start, slopes = problem_without(name, fit)
    return fit_once(study.target, problem, study.simulators, start, fit.correction, rounds=0, known_slopes=slopes)


def _without_each(names: Sequence[str], study: Study, fit: Fit) -> list[Fit]:
    """Models that lack one of these effects, once the others have made up for it as far as slopes tell."""

    def one(name: str) -> Fit:
        problem, start, slopes = problem_without(name, fit)
        still = partial(
            fit_once, study.target, problem, study.simulators, correction=fit.correction, rounds=0,
            free=np.zeros(len(problem), bool), known_slopes=slopes,
        )  # fmt: skip
        at_first = still(start)
        lengths = np.maximum(np.linalg.norm(at_first.slopes, axis=0), 1e-9)
        step = np.linalg.lstsq(at_first.slopes / lengths, at_first.left, rcond=_FLAT)[0] / lengths
        return min([at_first, still(at_first.vector + step)], key=lambda less: less.cost)

    return side_by_side([partial(one, name) for name in names])


def _needed(study: Study, fit: Fit, given: int, worth: float = 0.0) -> Fit:
    """The fit without the effects that held-out grasps do not ask for, or that are worth less than so many squares."""
    while names := _names(fit)[given:]:
        study.progress("fitting without each of them")
        held = study.heldout(fit)
        fits = _without_each(names, study, fit)
        needless = [
            less for less in fits
            if less.cost - fit.cost < worth
            or not is_beyond_chance(study.gains(study.heldout(less), held), LEAST_RISE)
        ]  # fmt: skip
        if not needless:
            break
        fit = min(needless, key=lambda less: less.cost)
    return fit


def _costs_of_absence(study: Study, fit: Fit) -> list[float]:
    """What leaving out each effect adds to the squares, once the others have made up for it as far as slopes tell.

    Slopes say nothing of an effect in steps, or of how far off a limit is: the model is simulated without each.
    """
    costs = []
    for index, done in enumerate(done_by_each(study, fit)):
        places = [i for i, entry in enumerate(fit.problem.entries) if entry.effect == index]
        background = Background(fit, study.numerical, without=places)
        left = [background.remove(fit.left + one) for one in (0.0, fit.weighted(done))]
        costs.append(float(left[1] @ left[1] - left[0] @ left[0]))
    return costs


def _at_the_end(study: Study, fit: Fit) -> Fit:
    """The model itself, fitted to the end; by the slopes that there are, if it leaves more than noise anyway."""
    target, problem, simulators = study.target, fit.problem, study.simulators
    if not is_worth_looking(study, fit):
        return fit_exactly(target, problem, simulators, fit.vector, fit.jacobian)
    near = fit_once(target, problem, simulators, fit.vector, known_slopes=fit.jacobian)
    held_still = np.zeros(len(problem), bool)  # for the slopes there
    return fit_once(target, problem, simulators, near.vector, near.correction, free=held_still)


def _steps(
    study: Study, steps: Sequence[Step], before: Fit, fit: Fit, rng: np.random.Generator, in_a_hurry: bool = False
) -> list[Step]:
    """The steps that found what a fit still has, and one for each effect that it has besides.

    Those come first whose absence costs most. In a hurry their evidence is what they gain all together.

    Args:
      study: the measurements.
      steps: that found effects before.
      before: the fit with those.
      fit: with all.
      rng: for the null distribution.
      in_a_hurry: whether there is no time to fit without each.
    """
    names = [name for name in _names(fit) if name not in _names(before)]
    if in_a_hurry:
        fits, on_few = [before] * len(names), _costs_of_absence(*study.on_few(fit))
        costs = np.array([on_few[_names(fit).index(name)] for name in names])
    else:
        fits = _without_each(names, study, fit)
        costs = np.array([less.cost - fit.cost for less in fits])
    costs = np.maximum(costs, 1e-9)
    changes = [Score(fit.effect(n), c, direction(less, fit)) for n, c, less in zip(names, costs, fits, strict=True)]
    null = null_gains([changes], rng)
    error, after = (study.error(study.heldout(one)) for one in (before, fit))
    fall = (error**2 - after**2) / costs.sum()
    found = [step for step in steps if step.is_counted or set(step.effects[:1]) & set(_names(fit))]
    for index in np.argsort(-costs):
        change, held = changes[index], study.heldout(fits[index])
        p_family = chance_of(change.gain, null)
        candidate = judged(study, held, fit, change.setting, p_family, change.signature)
        before_it, error = error, float(np.sqrt(max(error**2 - fall * costs[index], 0.0)))
        candidate = dataclasses.replace(candidate, error_after=error, without=fits[index])
        found.append(Step((change.setting.effect.name,), (candidate,), (), before_it, error))
    return chained(found, after)
