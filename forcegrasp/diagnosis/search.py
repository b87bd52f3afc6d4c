"""Finds out which physical effects a model lacks, one after the other, on evidence from grasps held out of the fit."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from forcegrasp.diagnosis.noise_check import Noise, unlike_said
from forcegrasp.diagnosis.refine import refine
from forcegrasp.diagnosis.signatures import Background, Score, Signatures, null_gains
from forcegrasp.diagnosis.verdict import conclude, explained_share
from forcegrasp.effects import Effect
from forcegrasp.effects.quantisation import Quantisation
from forcegrasp.identify.base_fit import BaseFit, rms_error
from forcegrasp.identify.cross_validation import heldout_residual, log_likelihood, make_folds, rms
from forcegrasp.identify.fit import Fit, Simulators, fit_exactly
from forcegrasp.identify.noise_floor import beyond_fit, cells, excess, numerical_error, numerical_floor
from forcegrasp.identify.target import Target
from forcegrasp.short_repr import ShortRepr, counted, some

#: Largest number of effects that are looked for.
MOST_EFFECTS = 6
#: Family-wise probability of a false alarm that is accepted at each step.
ALARM = 0.01
#: An effect must lower the error of some signal in some phase by this share; by more where all is at the floor already.
LEAST_GAIN, LEAST_GAIN_AT_FLOOR = 0.02, 0.1
#: An effect must explain this share of the mean square beyond the noise.
LEAST_SHARE = 0.25
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
# Effects whose signatures are that parallel can't be told apart, whatever the likelihood says.
_PARALLEL = 0.995
# An effect with fewer parameters that gains this share of what the best one gains can't be ruled out.
_NEARLY = 0.95


@dataclass(frozen=True, eq=False, repr=False)
class Candidate(ShortRepr):
    """One effect, refitted together with everything else."""

    effect: type[Effect]
    variant: str
    fit: Fit
    p_family: float  #: probability that the best signature of sensor noise does as well
    gains: np.ndarray  #: change of each held-out grasp's log-likelihood, ``(G,)``
    error_after: float  #: held-out rms residual ÷ noise
    share: float  #: share of the mean square beyond the noise that it explains
    largest_fall: float  #: largest share by which the error of a signal in a phase falls
    signature: np.ndarray  #: unit vector, ``(N,)``

    def summary(self) -> str:
        sizes = some(f"{name} {value:.3g}" for name, value in self.parameters().items())
        return f"{self.effect.name}: error {self.error_after:.2f} × noise, gain {self.heldout_gain:+.0f}, {sizes}"

    @property
    def heldout_gain(self) -> float:
        """Change of the held-out log-likelihood, all grasps together."""
        return float(np.nansum(self.gains))

    def parameters(self) -> dict[str, float]:
        """The effect's fitted parameters."""
        count = len(self.effect.parameters)
        return dict(zip((p.name for p in self.effect.parameters), map(float, self.fit.values[-count:]), strict=True))


@dataclass(frozen=True, repr=False)
class Step(ShortRepr):
    """One round of the search."""

    verdict: str  #: "effect", "one_of" or "none"
    effects: tuple[str, ...]  #: the effect found, or the set that can't be told apart, best first
    candidates: tuple[Candidate, ...]  #: refitted, best first
    scores: tuple[Score, ...]  #: best signature of each effect, best first
    error_before: float
    error_after: float

    def summary(self) -> str:
        told = f"error {self.error_before:.2f} → {self.error_after:.2f} × noise"
        return f"{self.verdict}: {some(self.effects)}; {told}, {counted(len(self.candidates), 'candidate')}"


@dataclass(frozen=True, repr=False)
class Diagnosis(ShortRepr):
    """What the data say that the model lacks."""

    verdict: str  #: "effect", "one_of", "explained", "unknown" or "not_fitted"
    effects: tuple[str, ...]  #: those in the model, in the order found; with "one_of" then the rivals of each
    steps: tuple[Step, ...]
    base: BaseFit
    fit: Fit  #: with the effects that were found
    target: Target
    folds: tuple[np.ndarray, ...]
    error_before: float
    error_after: float
    numerical: tuple[np.ndarray, ...] = field(default=())  #: of the final fit, each ``(G, S, C)``
    floor: float = 1.0  #: error that sensor noise and the model's own numerical error leave
    left: str = ""  #: where there is more than that, in words; empty if nowhere
    noise: Noise | None = None  #: what the noise is, if the residuals show that it is not what was said

    @property
    def preferred(self) -> tuple[str, ...]:
        """The effects that were found and are in the final model: of those that can't be told apart the first."""
        return tuple(step.effects[0] for step in self.steps if step.verdict != "none")

    @property
    def explained(self) -> float:
        """Share of the held-out mean square beyond the noise that the effects found explain."""
        noise = self.error_after if self.noise is not None and not self.left else 1.0
        return float(np.clip(explained_share(self.error_before, self.error_after, noise), 0.0, 1.0))

    def summary(self) -> str:
        told = f"error {self.error_before:.2f} → {self.error_after:.2f} × noise, floor {self.floor:.2f}"
        return f"{self.verdict}: {some(self.effects)}; {told}"

    def heldout(self) -> np.ndarray:
        """Residuals of held-out grasps under the final fit, ``(G, S, C)``."""
        return heldout_residual(self.fit, self.target, self.folds)


def diagnose(
    target: Target,
    base: BaseFit,
    simulators: Simulators,
    effects: Sequence[type[Effect]],
    rng: np.random.Generator,
    progress: Callable[[str], None] = lambda text: None,
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
    folds = tuple(make_folds(target.grasps))
    fit = base.fit
    # what rounding adds to the noise is an error as long as nobody has noticed it
    error_before = rms(heldout_residual(fit, target, folds) * (target.sigma / target.sensor_sigma), target)
    if not base.converged:
        return Diagnosis("not_fitted", (), (), base, fit, target, folds, error_before, error_before)
    of_base = numerical_error(fit, target)
    numerical = beyond_fit(fit, of_base)
    floor = numerical_floor(numerical, target)
    steps: list[Step] = []
    if any(target.rounding):
        error = rms(heldout_residual(fit, target, folds), target)
        progress("found quantisation: readings are multiples of one step")
        steps.append(Step("effect", (Quantisation.name,), (), (), error_before, error))
    signatures = Signatures(effects, target, simulators)
    for _ in range(MOST_EFFECTS):
        untried = [e for e in effects if e not in {known for known, _ in fit.problem.effects}]
        if not untried:
            break
        step = _look_further(target, fit, simulators, signatures, untried, folds, numerical, rng, progress)
        steps.append(step)
        if step.verdict == "none":
            break
        fit = step.candidates[0].fit
        progress(f"found {step.effects[0]}: held-out error {step.error_before:.2f} → {step.error_after:.2f} × noise")
        if not _left(fit, heldout_residual(fit, target, folds), numerical, target)[0]:
            break
    held = heldout_residual(fit, target, folds)
    error_after, (left, noise) = rms(held, target), _left(fit, held, numerical, target)
    found = [s for s in steps if s.verdict != "none"]
    verdict = conclude([s.verdict for s in found], error_before, error_after, floor, bool(left))
    names = [s.effects[0] for s in found] if verdict in ("effect", "one_of") else []
    if verdict == "one_of":
        names += [name for s in found for name in s.effects[1:]]
    of_final = of_base if fit is base.fit else numerical_error(fit, target)
    return Diagnosis(
        verdict, tuple(dict.fromkeys(names)), tuple(steps), base, fit, target, folds, error_before, error_after,
        of_final, floor, left, noise,
    )  # fmt: skip


def _left(fit: Fit, held: np.ndarray, numerical: Sequence[np.ndarray], target: Target) -> tuple[str, Noise | None]:
    """Where held-out residuals are more than noise, in words; and the noise, if it is not what was said."""
    noise = unlike_said(held, numerical, target, fit.predicted)
    return ("" if noise else excess(held, numerical, target)), noise


def _look_further(
    target: Target,
    fit: Fit,
    simulators: Simulators,
    signatures: Signatures,
    effects: Sequence[type[Effect]],
    folds: Sequence[np.ndarray],
    numerical: Sequence[np.ndarray],
    rng: np.random.Generator,
    progress: Callable[[str], None],
) -> Step:
    background = Background(fit, numerical)
    progress(f"trying {len(effects)} effects")
    new = signatures.missing(effects)
    signatures.simulate(fit, new)
    groups = signatures.scores(fit, background, effects)
    null = null_gains(groups, rng)
    stale = {
        g[0].effect for g in groups if g[0].gain > _RESIMULATE_RATIO * _refit_threshold(groups, null, fit, target)
    } - set(new)
    if stale:
        signatures.simulate(fit, stale)
        groups = signatures.scores(fit, background, effects)
    ranked = sorted((group[0] for group in groups), key=lambda s: -s.gain)
    held = heldout_residual(fit, target, folds)
    start = _Round(target, fit, simulators, background, folds, held)
    error = rms(held, target)
    least = _refit_threshold(groups, null, fit, target)
    hopeful = [s for s in ranked if s.gain > least][:_REFITTED]
    candidates = start.refit(hopeful, null, progress)
    best: dict[str, Candidate] = {}
    for candidate in sorted(candidates, key=lambda c: -c.heldout_gain):
        best.setdefault(candidate.effect.name, candidate)  # of several variants the best one
    ordered = start.refine_on_reference_tier(tuple(best.values()), progress)
    least_gain = LEAST_GAIN if excess(held, numerical, target) else LEAST_GAIN_AT_FLOOR
    if not ordered or not _is_significant(ordered[0], least_gain):
        return Step("none", (), ordered, tuple(ranked), error, error)
    winner = ordered[0]
    # of those that can't be told apart the simplest comes first
    equal = sorted(
        [winner, *(c for c in ordered[1:] if _indistinguishable(winner, c))], key=lambda c: len(c.effect.parameters)
    )
    ordered, winner = (*equal, *(c for c in ordered if c not in equal)), equal[0]
    names = tuple(c.effect.name for c in equal)
    verdict = "effect" if len(names) == 1 else "one_of"
    return Step(verdict, names, ordered, tuple(ranked), error, winner.error_after)


def _refit_threshold(groups: Sequence[Sequence[Score]], null: np.ndarray, fit: Fit, target: Target) -> float:
    """What a signature must gain for its effect to be worth a fit."""
    if not groups:
        return np.inf
    beyond = float(np.sum(fit.residual**2) - target.readings)
    best = max(group[0].gain for group in groups)
    return max(float(np.quantile(null, 1 - ALARM)), _MIN_GAIN_RATIO * best, _MAX_GAIN_FACTOR * LEAST_SHARE * beyond)


@dataclass(frozen=True, eq=False)
class _Round:
    """What one round of the search starts from."""

    target: Target
    fit: Fit
    simulators: Simulators
    background: Background
    folds: Sequence[np.ndarray]
    held: np.ndarray  #: residuals of held-out grasps, ``(G, S, C)``

    def refit(self, scores: Sequence[Score], null: np.ndarray, progress: Callable[[str], None]) -> list[Candidate]:
        """Rough fits with one more effect, from where the best signatures put them."""
        candidates = []
        for one in refine(scores, self.target, self.fit, self.simulators, self.background, progress):
            score = one.score
            p_family = (1 + int(np.sum(null >= score.gain))) / (1 + len(null))
            candidates.append(self._judge(score.effect, score.variant, one.fit, p_family, score.signature))
        return candidates

    def refine_on_reference_tier(
        self, ordered: Sequence[Candidate], progress: Callable[[str], None]
    ) -> tuple[Candidate, ...]:
        """Fits the best one, and those indistinguishable from it, on the reference tier: rough fits may stop short."""
        near = [c for c in ordered if c is ordered[0] or _indistinguishable(ordered[0], c)][:_REFINED]
        refined = []
        for c in near:
            progress(f"fitting {c.effect.name} {c.variant} to the end")
            refined.append(self._judge(c.effect, c.variant, self._to_the_end(c.fit), c.p_family, c.signature))
        refined.sort(key=lambda c: -c.heldout_gain)
        return (*refined, *(c for c in ordered if c not in near))

    def _to_the_end(self, rough: Fit) -> Fit:
        problem = rough.problem
        exact = fit_exactly(self.target, problem, self.simulators, rough.vector)
        if rms_error(exact, self.target) <= _ALL_FITTED:
            return exact
        # it may have ended where an effect's size meets a step of the simulation: come from the other side
        new = [e.effect for e in problem.entries].index(len(problem.effects) - 1)
        values, start = exact.values, exact.vector.copy()
        start[new] = problem.entries[new].coordinate(2 * values[new])
        return min(exact, fit_exactly(self.target, problem, self.simulators, start), key=lambda fit: fit.cost)

    def _judge(
        self, effect: type[Effect], variant: str, refit: Fit, p_family: float, signature: np.ndarray
    ) -> Candidate:
        """What held-out grasps say of a fit with one more effect."""
        target, held = self.target, self.held
        after = heldout_residual(refit, target, self.folds)
        gains = log_likelihood(after) - log_likelihood(held)
        fall = max((1 - rms(after, target, w) / rms(held, target, w) for _, w in cells(target)), default=0.0)
        error = rms(after, target)
        share = explained_share(rms(held, target), error)
        return Candidate(effect, variant, refit, p_family, gains, error, share, fall, signature)


def _is_significant(candidate: Candidate, least_gain: float) -> bool:
    gains = candidate.gains[np.isfinite(candidate.gains)]
    spread = gains.std(ddof=1) * np.sqrt(len(gains)) if len(gains) > 1 else np.inf
    return (
        candidate.p_family <= ALARM
        and gains.sum() > max(spread, 5.0)
        and candidate.largest_fall >= least_gain
        and candidate.share >= LEAST_SHARE
    )


def _indistinguishable(winner: Candidate, other: Candidate) -> bool:
    lead = winner.gains - other.gains
    lead = lead[np.isfinite(lead)]
    error = lead.std(ddof=1) * np.sqrt(len(lead)) if len(lead) > 1 else np.inf
    parallel = abs(float(winner.signature @ other.signature))
    simpler = len(other.effect.parameters) < len(winner.effect.parameters)
    nearly = simpler and other.heldout_gain > _NEARLY * winner.heldout_gain
    return other.heldout_gain > 0 and (lead.sum() <= error or parallel > _PARALLEL or nearly)
