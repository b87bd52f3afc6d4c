"""Puts two effects in the place of one that was found: what looks like one may be the sum of two."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np

from forcegrasp.diagnosis.families import may_join, roughly_as, roughly_without
from forcegrasp.diagnosis.result import Step
from forcegrasp.diagnosis.search.exchange import against, are_alike, at_most, does_better, steps_of
from forcegrasp.diagnosis.search.refine import refine
from forcegrasp.diagnosis.search.screen import Screen
from forcegrasp.diagnosis.search.step import look_further
from forcegrasp.diagnosis.signatures import Background, of_best_effects, trials
from forcegrasp.diagnosis.study import Study
from forcegrasp.effects import Effect
from forcegrasp.effects.setting import EffectSetting
from forcegrasp.identify.fit import Fit
from forcegrasp.identify.side_by_side import side_by_side

# So many effects are split, those that explain most; so many look-alikes of one may be the first of two, and so many
# effects the second of each.
_SPLIT, _FIRST, _SECOND = 3, 3, 3


def split(
    study: Study, fit: Fit, screen: Screen, effects: Sequence[type[Effect]], steps: Sequence[Step],
    rng: np.random.Generator,
) -> tuple[list[Step], Step] | None:  # fmt: skip
    """The steps with a look-alike in place of an effect, and a step that adds another one to it; None if none does.

    Positions and forces that are both read late, each in its own way, look much like a command that is late, and with
    that in the model neither does any better. So two are put in its place at once.

    Args:
      study: the measurements.
      fit: with all effects that were found.
      screen: of the catalogue.
      effects: those that are not in the model.
      steps: that found the effects.
      rng: for the null distribution.
    """
    held, most = study.heldout(fit), at_most(fit, study)
    known = {one.effect.name: one.effect for one in fit.problem.effects}
    for old in sorted(steps_of(fit, steps), key=lambda step: step.error_after - step.error_before)[:_SPLIT]:
        name = old.effects[0]
        gains = {score.setting.effect: score.gain for score in reversed(old.scores)}  # the best one of each
        alike = [e for e in effects if not e.of_set and are_alike(e, known[name])]
        alike = sorted(alike, key=lambda e: -gains.get(e, 0.0))[:_FIRST]
        study.progress(f"looking for two effects in place of {name}")
        for first in _first_of_two(study, fit, screen, effects, name, alike):
            start = roughly_as([first], fit, name, study)
            step = look_further(study, start, screen, _beside(first.effect, effects), rng, most=most)
            if not step.effects:
                continue
            best = step.candidates[0]
            if does_better(against(best, held, study)):
                study.progress(f"{first.effect.name} and {best.effect.name} do better than {name}")
                instead = _found_instead(old, best.fit.effects[-2], start, fit, study)
                if old is not steps[-1]:  # the steps after it go on from what it left
                    instead = dataclasses.replace(instead, error_after=old.error_after)
                left = [instead if one is old else one for one in steps]
                return left, dataclasses.replace(step, error_before=left[-1].error_after, of_many=False)
    return None


def _first_of_two(
    study: Study, fit: Fit, screen: Screen, effects: Sequence[type[Effect]], name: str, alike: Sequence[type[Effect]]
) -> Iterator[EffectSetting]:
    """Look-alikes of an effect that leave less than it on few grasps, together with one more effect; best first."""
    some, part = study.on_few(fit)
    promising = []
    for first in side_by_side([partial(roughly_as, trials([e]), part, name, some) for e in alike]):
        setting = first.effects[-1]
        groups, _ = screen.on_few(study, some, first, _beside(setting.effect, effects))
        scores = of_best_effects(sorted((group[0] for group in groups), key=lambda score: -score.gain), _SECOND)
        both = refine(scores, some, first, Background(first, some.numerical))
        promising.append((min((pair.fit.cost for pair in both), default=np.inf), setting))
    most = at_most(part, some)
    for cost, setting in sorted(promising, key=lambda pair: pair[0]):
        if cost < most:
            yield setting


def _beside(first: type[Effect], effects: Sequence[type[Effect]]) -> list[type[Effect]]:
    """Those of the effects that may stand beside another one."""
    return [e for e in effects if not e.of_set and may_join(e, [first]) and may_join(first, [e])]


def _found_instead(old: Step, setting: EffectSetting, alone: Fit, fit: Fit, study: Study) -> Step:
    """The step as if it had found this effect; what it had found is not looked for again.

    Args:
      old: the step.
      setting: the effect, as it is in the end.
      alone: a fit with it, before the other of the two.
      fit: with what the step had found.
      study: the measurements.
    """
    name, error = old.effects[0], study.error(study.heldout(alone))
    first = dataclasses.replace(
        old.candidates[0], setting=setting, fit=alone, error_after=error, replaces=old.replaces or name
    )
    first = against(first, study.heldout(roughly_without(name, fit, study)), study)
    others = [c for c in old.candidates[1:] if c.effect is not setting.effect]
    return dataclasses.replace(old, effects=(setting.effect.name,), candidates=(first, *others), error_after=error)
