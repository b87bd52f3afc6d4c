"""Puts a look-alike in the place of an effect that was found too early: what was still missing may have decided."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from forcegrasp.diagnosis.evidence import LEAST_RISE, is_beyond_chance
from forcegrasp.diagnosis.families import look_alike, roughly_without
from forcegrasp.diagnosis.result import Candidate, Step, kept_steps
from forcegrasp.diagnosis.search.screen import Screen
from forcegrasp.diagnosis.search.step import look_further
from forcegrasp.diagnosis.study import Study
from forcegrasp.diagnosis.verdict import LEAST_SHARE
from forcegrasp.effects import Effect
from forcegrasp.identify.fit import Fit


def exchange(
    study: Study, fit: Fit, screen: Screen, effects: Sequence[type[Effect]], steps: Sequence[Step],
    rng: np.random.Generator,
) -> Step | None:  # fmt: skip
    """A step that puts another effect in the place of one that was found; None if none does better.

    Each effect was chosen while those found later were missing, and one that is missing can make a look-alike of the
    truth fit better. So each is looked for again, with all others in the model, among those that look alike.

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
    names = [step.effects[0] for step in steps_of(fit, steps)]
    for name in names if len(names) > 1 else ():  # the only one was chosen with all there is in the model
        # a mistake of the set may look like anything
        alike = [e for e in effects if e.of_set or are_alike(e, known[name])]
        if not alike:
            continue
        study.progress(f"looking for what may stand in place of {name}")
        found = look_further(study, roughly_without(name, fit, study), screen, alike, rng, most=most)
        if not found.effects:
            continue
        best = dataclasses.replace(against(found.candidates[0], held, study), replaces=name)
        if does_better(best):
            study.progress(f"{best.effect.name} does better than {name}")
            candidates = (best, *(against(c, held, study) for c in found.candidates[1:]))
            return dataclasses.replace(found, candidates=candidates, error_before=study.error(held), of_many=False)
    return None


def at_most(fit: Fit, study: Study) -> float:
    """The cost that a fit must come down to, to be worth an exchange."""
    return fit.cost - LEAST_SHARE * study.target.beyond_noise(fit.residual)


def steps_of(fit: Fit, steps: Sequence[Step]) -> list[Step]:
    """The steps that found the effects that a fit has now, but for what was found by counting."""
    known = {one.effect.name for one in fit.problem.effects}
    return [step for step in kept_steps(steps) if step.effects[0] in known and not step.is_counted]


def does_better(candidate: Candidate) -> bool:
    """Whether a candidate that was judged :func:`against` a model does better than what it replaces there."""
    return is_beyond_chance(candidate.gains, LEAST_RISE) and candidate.share >= LEAST_SHARE


def against(candidate: Candidate, held: np.ndarray, study: Study) -> Candidate:
    """A candidate judged against the model that has what it may replace, by the residuals that this leaves."""
    after = study.heldout(candidate.fit)
    return dataclasses.replace(candidate, gains=study.gains(held, after), share=study.explained(held, after))


def are_alike(one: type[Effect], other: type[Effect]) -> bool:
    """Whether the catalogue says of two effects that they look alike, or that they are of one kind."""
    return look_alike(one, other) or one.family == other.family
