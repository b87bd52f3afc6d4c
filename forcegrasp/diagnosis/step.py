"""One step of the search: which effect, if any, explains best what a fit leaves."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from forcegrasp.diagnosis.evidence import (
    ALARM,
    LEAST_GAIN,
    LEAST_GAIN_AT_FLOOR,
    LEAST_SHARE,
    indistinguishable,
    is_significant,
)
from forcegrasp.diagnosis.refine import refine
from forcegrasp.diagnosis.result import Candidate, Step
from forcegrasp.diagnosis.signatures import Background, Score, Signatures, null_gains
from forcegrasp.diagnosis.study import Study
from forcegrasp.diagnosis.verdict import explained_share
from forcegrasp.effects import Effect
from forcegrasp.identify.base_fit import rms_error
from forcegrasp.identify.cross_validation import log_likelihood, rms
from forcegrasp.identify.fit import Fit, fit_exactly
from forcegrasp.identify.noise_floor import cells, excess

# Refitted per step: signatures only rank.
_REFITTED = 5
# Of these the best ones are fitted to the end.
_REFINED = 3
# A signature this much worse than the best is not refitted.
_MIN_GAIN_RATIO = 0.2
# A refit gains at most about twice what a signature promises.
_MAX_GAIN_FACTOR = 0.5
# A signature of an earlier round is simulated anew if it gains this share of what makes its effect worth a fit.
_RESIMULATE_RATIO = 0.3
# An error of so many times the noise leaves nothing to look for.
_ALL_FITTED = 1.05


def look_further(
    study: Study, fit: Fit, signatures: Signatures, effects: Sequence[type[Effect]], rng: np.random.Generator
) -> Step:
    """Looks for one more effect.

    Args:
      study: the measurements.
      fit: with the effects that were found so far.
      signatures: of all effects, as they were simulated last.
      effects: those that are not in the model.
      rng: for the null distribution.
    """
    start = _Start(study, fit)
    study.progress(f"trying {len(effects)} effects")
    new = signatures.missing(effects)
    signatures.simulate(fit, new)
    groups = signatures.scores(fit, start.background, effects)
    null = null_gains(groups, rng)
    threshold = start.refit_threshold(groups, null)
    stale = {g[0].setting.effect for g in groups if g[0].gain > _RESIMULATE_RATIO * threshold} - set(new)
    if stale:
        signatures.simulate(fit, stale)
        groups = signatures.scores(fit, start.background, effects)
        threshold = start.refit_threshold(groups, null)
    ranked = sorted((group[0] for group in groups), key=lambda s: -s.gain)
    candidates = start.refit([s for s in ranked if s.gain > threshold][:_REFITTED], null)
    best: dict[str, Candidate] = {}
    for candidate in sorted(candidates, key=lambda c: -c.heldout_gain):
        best.setdefault(candidate.effect.name, candidate)  # of several variants the best one
    ordered = start.refine_on_reference_tier(tuple(best.values()))
    least_gain = LEAST_GAIN if excess(start.held, study.numerical, study.target) else LEAST_GAIN_AT_FLOOR
    if not ordered or not is_significant(ordered[0], least_gain):
        return Step((), ordered, tuple(ranked), start.error, start.error)
    winner = ordered[0]
    # of those that can't be told apart the simplest comes first
    equal = sorted(
        [winner, *(c for c in ordered[1:] if indistinguishable(winner, c))], key=lambda c: len(c.effect.parameters)
    )
    ordered = (*equal, *(c for c in ordered if c not in equal))
    names = tuple(c.effect.name for c in equal)
    return Step(names, ordered, tuple(ranked), start.error, equal[0].error_after)


class _Start:
    """What a step starts from: a fit, and what it leaves.

    Args:
      study: the measurements.
      fit: with the effects that were found so far.
    """

    def __init__(self, study: Study, fit: Fit) -> None:
        self._study, self._fit = study, fit
        self.background = Background(fit, study.numerical)
        self.held = study.heldout(fit)  #: residuals of held-out grasps, ``(G, S, C)``
        self.error = rms(self.held, study.target)

    def refit_threshold(self, groups: Sequence[Sequence[Score]], null: np.ndarray) -> float:
        """What a signature must gain for its effect to be worth a fit."""
        if not groups:
            return np.inf
        beyond = float(np.sum(self._fit.residual**2) - self._study.target.readings)
        best = max(group[0].gain for group in groups)
        return max(float(np.quantile(null, 1 - ALARM)), _MIN_GAIN_RATIO * best, _MAX_GAIN_FACTOR * LEAST_SHARE * beyond)

    def refit(self, scores: Sequence[Score], null: np.ndarray) -> list[Candidate]:
        """Rough fits with one more effect, from where the best signatures put them."""
        candidates = []
        for one in refine(scores, self._study, self._fit, self.background):
            p_family = (1 + int(np.sum(null >= one.score.gain))) / (1 + len(null))
            candidates.append(self._judge(one.fit, p_family, one.score.signature))
        return candidates

    def refine_on_reference_tier(self, ordered: Sequence[Candidate]) -> tuple[Candidate, ...]:
        """Fits the best one, and those indistinguishable from it, on the reference tier: rough fits may stop short."""
        near = [c for c in ordered if c is ordered[0] or indistinguishable(ordered[0], c)][:_REFINED]
        refined = []
        for c in near:
            self._study.progress(f"fitting {c.effect.name} {c.setting.variant} to the end")
            refined.append(self._judge(self._to_the_end(c.fit), c.p_family, c.signature))
        refined.sort(key=lambda c: -c.heldout_gain)
        return (*refined, *(c for c in ordered if c not in near))

    def _to_the_end(self, rough: Fit) -> Fit:
        problem, target, simulators = rough.problem, self._study.target, self._study.simulators
        exact = fit_exactly(target, problem, simulators, rough.vector)
        if rms_error(exact, target) <= _ALL_FITTED:
            return exact
        # it may have ended where an effect's size meets a step of the simulation: come from the other side
        new = [e.effect for e in problem.entries].index(len(problem.effects) - 1)
        values, start = exact.values, exact.vector.copy()
        start[new] = problem.entries[new].coordinate(2 * values[new])
        return min(exact, fit_exactly(target, problem, simulators, start), key=lambda fit: fit.cost)

    def _judge(self, refit: Fit, p_family: float, signature: np.ndarray) -> Candidate:
        """What held-out grasps say of a fit with one more effect, its last one."""
        target, held, after = self._study.target, self.held, self._study.heldout(refit)
        gains = log_likelihood(after) - log_likelihood(held)
        fall = max((1 - rms(after, target, w) / rms(held, target, w) for _, w in cells(target)), default=0.0)
        error = rms(after, target)
        share = explained_share(self.error, error)
        setting = refit.problem.case(refit.vector).effects[-1]
        return Candidate(setting, refit, p_family, gains, error, share, fall, signature)
