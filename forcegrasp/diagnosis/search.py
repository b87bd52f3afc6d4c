"""Finds out which physical effects a model lacks, one after the other, on evidence from grasps held out of the fit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from forcegrasp.diagnosis.noise_check import Noise, unexpected_noise
from forcegrasp.diagnosis.refine import refine
from forcegrasp.diagnosis.result import Candidate, Diagnosis, Step
from forcegrasp.diagnosis.signatures import Background, Score, Signatures, null_gains
from forcegrasp.diagnosis.study import Study
from forcegrasp.diagnosis.verdict import conclude, explained_share
from forcegrasp.effects import Effect
from forcegrasp.identify.base_fit import BaseFit, rms_error
from forcegrasp.identify.cross_validation import heldout_residual, log_likelihood, make_folds, rms
from forcegrasp.identify.fit import Fit, Simulators, fit_exactly
from forcegrasp.identify.noise_floor import beyond_fit, cells, excess, numerical_error, numerical_floor
from forcegrasp.identify.progress import Progress, silent
from forcegrasp.identify.target import Target
from forcegrasp.identify.verdict import Verdict

#: Largest number of effects that are looked for.
MOST_EFFECTS = 6
#: Family-wise probability of a false alarm that is accepted at each step.
ALARM = 0.01
#: An effect must lower the error of some signal in some phase by this share; by more where all is at the floor already.
LEAST_GAIN, LEAST_GAIN_AT_FLOOR = 0.02, 0.1
#: An effect must explain this share of the mean square beyond the noise.
LEAST_SHARE = 0.25
# Effects whose signatures are that parallel can't be told apart, whatever the likelihood says.
_PARALLEL = 0.995
# An effect with fewer parameters that gains this share of what the best one gains can't be ruled out.
_NEARLY = 0.95
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


def diagnose(
    target: Target,
    base: BaseFit,
    simulators: Simulators,
    effects: Sequence[type[Effect]],
    rng: np.random.Generator,
    progress: Progress = silent,
) -> Diagnosis:
    """Adds effects to a fitted base model for as long as the evidence holds.

    Args:
      target: the measurements.
      base: the fitted base model, possibly with effects already in it.
      simulators: of the same grasps.
      effects: the catalogue.
      rng: for the null distribution.
      progress: told what is going on.
    """
    fit, folds = base.fit, tuple(make_folds(target.grasps))
    error_before = rms(target.before_rounding(heldout_residual(fit, target, folds)), target)
    of_base = numerical_error(fit, target)
    study = Study(target, simulators, folds, beyond_fit(fit, of_base), progress)
    floor = numerical_floor(study.numerical, target)
    steps: list[Step] = []
    if (rounding := target.rounding) is not None:
        progress(f"found {rounding.effect.name}: readings are multiples of one step")
        steps.append(Step((rounding.effect.name,), (), (), error_before, rms(study.heldout(fit), target)))
    signatures = Signatures(effects, study)
    for _ in range(MOST_EFFECTS):
        untried = [e for e in effects if e not in {known.effect for known in fit.problem.effects}]
        if not untried:
            break
        step = look_further(study, fit, signatures, untried, rng)
        steps.append(step)
        if not step.effects:
            break
        fit = step.candidates[0].fit
        progress(f"found {step.effects[0]}: held-out error {step.error_before:.2f} → {step.error_after:.2f} × noise")
        if not _left(study, fit)[0]:
            break
    error_after, (left, noise) = rms(study.heldout(fit), target), _left(study, fit)
    found = [s for s in steps if s.effects]
    # a missing effect makes the error rough, and the base fit stop short: then only what leaves nothing is an answer
    if not base.converged and (left or not found):
        return Diagnosis(Verdict.NOT_FITTED, (), (), base, base.fit, target, folds, error_before, error_before)
    verdict = conclude([s.verdict for s in found if s.verdict], error_before, error_after, floor, bool(left))
    names = [s.effects[0] for s in found] if verdict.names_effects else []
    if verdict is Verdict.ONE_OF:
        names += [name for s in found for name in s.effects[1:]]
    of_final = of_base if fit is base.fit else numerical_error(fit, target)
    return Diagnosis(
        verdict, tuple(dict.fromkeys(names)), tuple(steps), base, fit, target, folds, error_before, error_after,
        of_final, floor, left, noise,
    )  # fmt: skip


def _left(study: Study, fit: Fit) -> tuple[str, Noise | None]:
    """Where held-out residuals are more than noise, in words; and the noise, if it is not as assumed."""
    held = study.heldout(fit)
    noise = unexpected_noise(held, study.numerical, study.target, fit.predicted)
    return ("" if noise else excess(held, study.numerical, study.target)), noise


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


def is_significant(candidate: Candidate, least_gain: float) -> bool:
    """Whether noise would hardly do as well: ``least_gain`` is the share by which some signal's error must fall."""
    gains = candidate.gains[np.isfinite(candidate.gains)]
    spread = gains.std(ddof=1) * np.sqrt(len(gains)) if len(gains) > 1 else np.inf
    return (
        candidate.p_family <= ALARM
        and gains.sum() > max(spread, 5.0)
        and candidate.largest_fall >= least_gain
        and candidate.share >= LEAST_SHARE
    )


def indistinguishable(winner: Candidate, other: Candidate) -> bool:
    """Whether these data can't tell another effect from the best one."""
    lead = winner.gains - other.gains
    lead = lead[np.isfinite(lead)]
    error = lead.std(ddof=1) * np.sqrt(len(lead)) if len(lead) > 1 else np.inf
    parallel = abs(float(winner.signature @ other.signature))
    simpler = len(other.effect.parameters) < len(winner.effect.parameters)
    nearly = simpler and other.heldout_gain > _NEARLY * winner.heldout_gain
    return other.heldout_gain > 0 and (lead.sum() <= error or parallel > _PARALLEL or nearly)
