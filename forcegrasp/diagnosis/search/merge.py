"""Puts one effect in the place of two that were found, where it does for both: their sum may look like it."""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Iterator, Sequence
from functools import partial
from itertools import combinations

import numpy as np

from forcegrasp.diagnosis.evidence import LEAST_RISE, nearly_as_much
from forcegrasp.diagnosis.families import (
    may_join,
    problem_without,
    refit_as,
    refit_without,
    roughly_as,
    roughly_without,
)
from forcegrasp.diagnosis.result import Step, kept_steps
from forcegrasp.diagnosis.search.exchange import are_alike
from forcegrasp.diagnosis.search.needless import SURELY, asks_for_more, chained, is_enough
from forcegrasp.diagnosis.signatures import Background, Signatures, trials
from forcegrasp.diagnosis.study import Study
from forcegrasp.effects import Effect
from forcegrasp.effects.setting import EffectSetting
from forcegrasp.identify.fit import Fit, fit_once
from forcegrasp.identify.side_by_side import side_by_side

# Signatures are straight: an effect that does for two promises at least this share of what they explain.
_PROMISE = 0.5


def merge(
    study: Study, steps: Sequence[Step], fit: Fit, effects: Sequence[type[Effect]], given: int
) -> tuple[list[Step], Fit]:
    """The steps with one effect in place of two, where held-out grasps do not ask for both; and the fit.

    What was still missing may have made half of an effect fit better than the whole: positions that are read late, and
    forces that are, are a late command.

    Args:
      study: the measurements.
      steps: that found the effects.
      fit: with all effects.
      effects: the catalogue.
      given: number of effects that were in the model before the search; they stay.
    """
    left = list(steps)
    while found := _one_for_two(study, left, fit, effects, given):
        pair, fit = found
        left = _with_one(study, left, fit, pair)
    return left, fit


def _one_for_two(
    study: Study, steps: Sequence[Step], fit: Fit, effects: Sequence[type[Effect]], given: int
) -> tuple[tuple[str, str], Fit] | None:
    """Two effects of which another one does for both, and the fit with that."""
    held, few = study.heldout(fit), study.on_few(fit)
    searched = {one.effect.name for one in fit.problem.effects[given:]}
    found = [step.effects[0] for step in kept_steps(steps) if step.candidates and step.effects[0] in searched]
    pairs = [(pair, alike) for pair in combinations(found, 2) if (alike := list(_like_both(pair, fit, effects)))]
    near = side_by_side([partial(_near_enough, *few, pair, alike) for pair, alike in pairs])
    tried = [(pair, effect) for (pair, _), some in zip(pairs, near, strict=True) for effect in some]
    for pair, effect in tried:
        study.progress(f"fitting with {effect.name} in place of {pair[0]} and {pair[1]}")
    settings = side_by_side([partial(_roughly_as_good, *few, pair, effect) for pair, effect in tried])
    for (pair, effect), setting in zip(tried, settings, strict=True):
        if setting is None:
            continue
        less, without = refit_as(setting, fit, pair, study), refit_without(pair, fit, study)
        if is_enough(study, study.heldout(without), study.heldout(less), held):
            study.progress(f"{effect.name} does for both")
            return pair, less
    return None


def _like_both(pair: Collection[str], fit: Fit, effects: Sequence[type[Effect]]) -> Iterator[type[Effect]]:
    """Effects that look like both of two, and may stand beside all others of the model.

    So may each of the two, if they look alike: a part of it may have been explained by the other, found first, and no
    slope leads from there to where it explains all.
    """
    known = [one.effect for one in fit.problem.effects]
    two, others = [e for e in known if e.name in pair], [e for e in known if e.name not in pair]
    for effect in effects:
        both = [one for one in two if one is not effect]
        alike = all(are_alike(effect, one) for one in both)
        if (
            alike
            and may_join(effect, others)
            and not effect.of_set
            and (len(both) == 2 or effect.family == both[0].family)
        ):
            yield effect


def _near_enough(
    study: Study, fit: Fit, pair: Sequence[str], effects: Sequence[type[Effect]]
) -> Sequence[type[Effect]]:
    """Those of the effects that are worth a fit in the place of two.

    All of them where these look like each other: then one may well do for both, however little its signature says,
    which of what is large is not much.
    """
    one, other = (fit.effect(name).effect for name in pair)
    return effects if are_alike(one, other) else promising(study, fit, pair, effects)


def promising(
    study: Study, fit: Fit, names: str | Collection[str], effects: Sequence[type[Effect]]
) -> list[type[Effect]]:
    """Those of the effects whose signatures, without those of these names, come near enough to what these explain."""
    problem, start, slopes = problem_without(names, fit)
    without = fit_once(study.target, problem, study.simulators, start, fit.correction, rounds=0, known_slopes=slopes)
    signatures, tried = Signatures(study), trials(effects)
    signatures.simulate(without, tried)
    scores = signatures.scores(without, Background(without, study.numerical), tried)
    least = _PROMISE * (without.cost - fit.cost)
    return list(dict.fromkeys(of_kind[0].setting.effect for of_kind in scores if of_kind[0].gain > least))


def _roughly_as_good(study: Study, fit: Fit, pair: Collection[str], effect: type[Effect]) -> EffectSetting | None:
    """The effect as a rough fit has it, unless that leaves something, and says clearly that the others are needed.

    One of the two itself whose cost has valleys, as lost motion, may have ended in another one: then all grasps decide.
    """
    less = roughly_as(trials([effect]), fit, pair, study, at_the_end=False)
    if effect.name in pair and effect.in_valleys:
        return less.effects[-1]
    if asks_for_more(study, less.residual, fit.residual, SURELY * LEAST_RISE):
        return None
    without = roughly_without(pair, fit, study, at_the_end=False)
    gain, most = (float(np.nansum(study.gains(without.residual, one.residual))) for one in (less, fit))
    return less.effects[-1] if nearly_as_much(gain, most) else None


def _with_one(study: Study, steps: Sequence[Step], fit: Fit, pair: Collection[str]) -> list[Step]:
    """The steps without the one that found the first of two effects; that of the second found what stands for both."""
    kept = kept_steps(steps)
    first, second = (step for step in kept if step.effects[0] in pair)
    both = [step.candidates[0] for step in (first, second)]
    error = study.error(study.heldout(fit))
    one = dataclasses.replace(
        both[1],
        setting=fit.effects[-1],
        fit=fit,
        p_family=min(c.p_family for c in both),
        gains=both[0].gains + both[1].gains,
        of_recordings=_added([c.of_recordings for c in both]),
        error_after=error,
        replaces="",
        without=None,
    )
    others = [c for c in second.candidates[1:] if c.effect is not one.effect]
    merged = dataclasses.replace(
        second, effects=(one.effect.name,), candidates=(one, *others), error_after=error, of_many=False
    )
    left = [merged if s is second else s for s in steps if s is not first and (s in kept or not s.effects)]
    left[0] = dataclasses.replace(left[0], error_before=steps[0].error_before)
    return chained(left, error)


def _added(gains: Sequence[np.ndarray | None]) -> np.ndarray | None:
    known = [one for one in gains if one is not None]
    return np.sum(known, axis=0) if len(known) == len(gains) else None
