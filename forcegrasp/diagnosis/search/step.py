"""One step of the search: refits with one more effect, judged on held-out grasps."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from forcegrasp.diagnosis.evidence import LEAST_SHARE_OF_MANY, indistinguishable
from forcegrasp.diagnosis.result import Candidate, Step
from forcegrasp.diagnosis.search.finalists import Finalists
from forcegrasp.diagnosis.search.rough_fits import RoughFits
from forcegrasp.diagnosis.search.screen import Screen
from forcegrasp.diagnosis.search.start import Start, least_cost
from forcegrasp.diagnosis.signatures import of_best_effects
from forcegrasp.diagnosis.study import Study
from forcegrasp.diagnosis.verdict import EXPLAINED
from forcegrasp.effects import Effect
from forcegrasp.identify.fit import Fit

# What all signatures together promise, so that effects that explain little each are tried: straight as they are, they
# promise less than effects explain, and what a set gives may be off besides.
_WORTH_A_TRIAL = 0.4
# Refitted per step: signatures only rank, and rank badly where an effect is large. So whatever promises this share of
# the best is refitted, too: contacts that press at once came sixth, with 0.7 of what larger objects promised.
_REFITTED, _NEAR_THE_BEST = 5, 0.5


def look_further(
    study: Study,
    fit: Fit,
    screen: Screen,
    effects: Sequence[type[Effect]],
    rng: np.random.Generator,
    richer: Sequence[tuple[str, type[Effect]]] = (),
    most: float = np.inf,
    anyway: bool = False,
    least_promise: float = _WORTH_A_TRIAL,
    before: Sequence[Candidate] = (),
    least_together: float = 0.0,
) -> Step:
    """Looks for one more effect.

    Args:
      study: the measurements.
      fit: with the effects that were found so far.
      screen: of the catalogue.
      effects: those that are not in the model.
      rng: for the null distribution.
      richer: names of effects in the model, each with one that contains it and may take its place.
      most: cost that a fit with the effect must come down to; one that is too far from it is not looked for.
      anyway: whether effects are fitted whose signatures promise too little: where parameters are far from where the
        effect would have them, slopes tell little of what it gains.
      least_promise: share that all signatures together must promise for an effect that explains little to be tried.
      before: what was fitted for another screen of this fit, best first: it is not fitted again.
      least_together: share that all signatures together must promise where no rough fit explains half: what promises
        less is not known, and none of those that stand for a part of it is fitted to the end.
    """
    start = Start(study, fit)
    if effects:
        study.progress(f"trying {len(effects)} effects")
    look = screen.look(study, fit, start.background, effects, start.noise, rng)
    rough, finalists = RoughFits(start, look.null), Finalists(start, effects, look.null)
    if anyway:
        tried = rough.anyway(look.scores)
        candidates = [one for one in tried if start.shows(one, LEAST_SHARE_OF_MANY)]  # signatures promised nothing
    else:
        near = [score for score in look.worth_a_fit if score.gain > _NEAR_THE_BEST * look.worth_a_fit[0].gain]
        count = max(_REFITTED, len({score.setting.effect for score in near}))
        fitted = {candidate.effect for candidate in before}
        best = of_best_effects(look.worth_a_fit, count)
        candidates = rough.of([score for score in best if score.setting.effect not in fitted])
    candidates = [one for one in candidates if least_cost(one.fit, fit) < most]
    candidates += rough.of_richer(richer)
    if look.share_together < least_together and max((c.share for c in candidates), default=0.0) < EXPLAINED:
        promising = tuple(sorted(candidates, key=start.place))
        return Step((), promising, look.scores, start.error, start.error, of_none=True)
    variants: dict[str, list[Candidate]] = {}
    for candidate in start.best_first(candidates):
        variants.setdefault(candidate.effect.name, []).append(candidate)
    ordered, redundant = finalists.fitted(list(variants.values()))
    screens = sorted([some for some in (ordered, before) if some], key=lambda some: start.place(some[0]))
    ordered = tuple(candidate for some in screens for candidate in some)
    of_many = bool(ordered) and not start.shows(ordered[0])
    if not ordered or (of_many and not start.may_be_of_many(ordered[0], look.share_together, least_promise)):
        return Step((), ordered, look.scores, start.error, start.error)
    winner, later = finalists.simpler_first(ordered)
    others = [c for c in ordered if (c.effect, c.replaces) != (winner.effect, winner.replaces)]
    rivals = [c for c in others if c.effect.name not in redundant | later]
    # of those that can't be told apart the simplest comes first
    equal = sorted(
        [winner, *(c for c in rivals if indistinguishable(winner, c))],
        key=lambda c: len(c.effect.parameters),
    )
    ordered = (*equal, *(c for c in others if c not in equal))
    names = tuple(c.effect.name for c in equal)
    return Step(names, ordered, look.scores, start.error, equal[0].error_after, of_many)
