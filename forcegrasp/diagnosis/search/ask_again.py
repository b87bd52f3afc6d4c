"""Asks again between effects that could not be told apart, once all that was missing besides is in the model."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np

from forcegrasp.diagnosis.evidence import indistinguishable, rivals_in
from forcegrasp.diagnosis.families import look_alike, look_alikes_of, may_join, refit_as, refit_without, roughly_as
from forcegrasp.diagnosis.result import Candidate, Step
from forcegrasp.diagnosis.search.exchange import against, steps_of
from forcegrasp.diagnosis.search.merge import promising
from forcegrasp.diagnosis.search.needless import chained
from forcegrasp.diagnosis.search.refine import AS_GOOD, NO_BETTER, refine_anyway
from forcegrasp.diagnosis.signatures import direction, trials
from forcegrasp.diagnosis.study import Study
from forcegrasp.effects import Effect
from forcegrasp.identify.fit import Fit
from forcegrasp.identify.side_by_side import side_by_side


def ask_again(
    study: Study, steps: Sequence[Step], fit: Fit, effects: Sequence[type[Effect]] = (), at_floor: bool = False
) -> tuple[list[Step], Fit]:
    """The steps less those rivals that the whole model tells apart, or with one in the first one's place; and the fit.

    Two effects may have fitted alike only because what was still missing hid the difference. Of the step that found
    the last effect all was in the model already. Those that were found at once had no rivals yet.

    Args:
      study: the measurements.
      steps: that found the effects.
      fit: with all effects.
      effects: that may do better than one of their family that was found when others were still missing.
      at_floor: whether the model leaves no more than noise. Nothing does better then; but what was found at once may
        still be of the set, where it was taken for the gripper's, or the other way round.
    """
    left, found = list(steps), steps_of(fit, steps)
    for step in found:
        if step.candidates[0].without is not None:
            own = fit.effect(step.effects[0]).effect
            asked = [e for e in effects if not at_floor or e.of_set != own.of_set]
            rivals = list(_in_its_place(study, step, fit, asked, of_any_family=True, most=AS_GOOD))
        elif step is not found[-1]:
            rivals = [*rivals_in(step, fit), *_in_its_place(study, step, fit, () if at_floor else effects)]
        else:
            rivals = []
        if rivals:
            left[left.index(step)], fit = _asked(study, step, rivals, fit)
    return (left if left == list(steps) else chained(left, study.error(study.heldout(fit)))), fit


def _in_its_place(
    study: Study, step: Step, fit: Fit, effects: Sequence[type[Effect]], of_any_family: bool = False,
    most: float = NO_BETTER,
) -> Iterator[Candidate]:  # fmt: skip
    """Candidates in the place of the effect that a step found that leave less on few grasps, or as little.

    Args:
      study: the measurements.
      step: that found the effect.
      fit: with all effects.
      effects: those that are asked, if they look like it and are of its family.
      of_any_family: whether they may be of another one, or a mistake of the set.
      most: share of what the fit leaves that one may leave on few grasps.
    """
    own = fit.effect(step.effects[0]).effect
    others = [one.effect for one in fit.problem.effects if one.effect is not own]
    look_alikes = [e for e in effects if look_alike(e, own)] if of_any_family else look_alikes_of(own, effects)
    alike = [e for e in look_alikes if e.name not in step.effects and may_join(e, [*others, own])]
    if of_any_family and alike:  # which are many
        alike = promising(*study.on_few(fit), own.name, alike)
    for better in refine_anyway(alike, study, fit, own.name, most) if alike else ():
        signature = direction(fit, better)
        yield dataclasses.replace(step.candidates[0], setting=better.effects[-1], fit=better, signature=signature)


def _asked(study: Study, step: Step, rivals: Sequence[Candidate], fit: Fit) -> tuple[Step, Fit]:
    """A step with those of its rivals that the whole model can't tell apart; and the model with the first of them."""
    own = step.effects[0]
    study.progress(f"asking again whether {' or '.join([own, *(c.effect.name for c in rivals)])}")
    without = study.heldout(refit_without(own, fit, study))
    fits = side_by_side([partial(_with_rival, one, fit, own, study) for one in rivals])
    first = _judged(step.candidates[0], fit, without, study)
    judged = [_judged(one, rival, without, study) for one, rival in zip(rivals, fits, strict=True)]
    best = max([first, *judged], key=lambda c: c.heldout_gain)
    if best is not first and indistinguishable(best, first):
        best = first
    # what the best one leaves is of something else, which may well have decided by no more than that
    least = best.fit.cost + max(0.0, study.target.beyond_noise(best.fit.residual))
    apart = {c.effect.name for c in (first, *judged) if c.fit.cost > least and not indistinguishable(best, c)}
    every = dict.fromkeys([*step.effects, *(c.effect.name for c in rivals)])
    names = [best.effect.name, *(n for n in every if n != best.effect.name and n not in apart)]
    new = [c for c in judged if c.effect.name not in {one.effect.name for one in step.candidates}]
    as_found = sorted(
        [*step.candidates, *new], key=lambda c: names.index(c.effect.name) if c.effect.name in names else len(names)
    )
    return dataclasses.replace(step, effects=tuple(names), candidates=tuple(as_found)), best.fit


def _with_rival(rival: Candidate, fit: Fit, own: str, study: Study) -> Fit:
    """The whole model with a rival in an effect's place, from the best of the sizes that a diagnosis tries."""
    rough = roughly_as([rival.setting, *trials([rival.effect])], fit, own, study, at_the_end=False)
    return refit_as(rough.effects[-1], fit, own, study)


def _judged(candidate: Candidate, fit: Fit, without: np.ndarray, study: Study) -> Candidate:
    """A candidate by what it gains in a whole model, ``without`` being the held-out residuals of one that lacks it."""
    judged = against(dataclasses.replace(candidate, fit=fit), without, study)
    recordings = study.of_recordings(judged.gains)
    sums = np.array([one.sum() for one in recordings]) if recordings else None
    return dataclasses.replace(judged, of_recordings=sums)
