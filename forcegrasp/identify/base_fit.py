"""Fits the base model from several starts, and says whether it converged."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from forcegrasp.identify.cross_validation import rms
from forcegrasp.identify.fit import Fit, descend_roughly, fit_exactly, fit_once
from forcegrasp.identify.initial_guess import guess
from forcegrasp.identify.larger_steps import lead_astray
from forcegrasp.identify.problem import Problem
from forcegrasp.identify.progress import Progress, silent
from forcegrasp.identify.side_by_side import side_by_side
from forcegrasp.identify.simulators import LARGE_STEP, STEP, Simulators
from forcegrasp.identify.target import Target
from forcegrasp.short_repr import ShortRepr

#: Number of starts; and of those at most, where fewer than two of them end in the best place found.
STARTS, MOST_STARTS = 3, 6
# The further starts see this many grasps of each object: enough to tell whether there is another optimum.
_GRASPS_PER_OBJECT = 2
# Where these do not agree, so many of the best are fitted to the end, on all grasps.
_FINISHED = 3
# Starts end in the same place if their costs agree to this share, or to this much per residual.
_SAME_SHARE, _SAME_COST = 0.01, 0.002
# Up to so many times the noise, a fit is where it should be, wherever others ended.
_NOISE_ALONE = 1.1
# Beyond so many times the noise an effect is missing, or the set is wrong, wherever exactly a fit ends.
_MUCH = 1.5
# Where an effect is missing the cost has many minima: starts agree if their costs beyond the noise do to this share.
_SAME_BEYOND = 0.2
# A fit had stopped short if on few grasps it goes on by this share of what it leaves beyond the noise.
_WENT_ON = 0.5
# So many patient fits, each from where the one before ended.
_SETTLING = 3
# Largest slope at an optimum, in standard errors of the parameter; those of a noisy simulator never vanish.
_MAX_GRADIENT = 5.0


@dataclass(frozen=True, repr=False)
class BaseFit(ShortRepr):
    """The best of several fits, and whether it converged, which a diagnosis needs."""

    fit: Fit
    errors: tuple[float, ...]  #: rms residual ÷ noise where each start ended
    converged: bool
    reason: str = ""  #: why it is not, in words
    starts_agree: bool = True  #: whether two starts at least ended in the best place
    settled: bool = False  #: whether no step lowers the error, however short, though slopes say so: contacts are rough
    unfinished: bool = False  #: whether it was left before its end, as it leaves much: see :func:`finished`


def fit_base(
    target: Target,
    problem: Problem,
    simulators: Simulators,
    rng: np.random.Generator,
    progress: Progress = silent,
    hasty: bool = False,
) -> BaseFit:
    """Fits from the nominal parameters, and then looks from random places inside the bounds for a better optimum.

    Args:
      target: the measurements.
      problem: what may be changed.
      simulators: of the problem's grasps.
      rng: for the random places.
      progress: told what is going on.
      hasty: leaves a fit that is much more than noise before its end: that takes long, and an effect is missing anyway.
    """
    first = fit_once(target, problem, simulators, guess(target, problem))
    progress(f"base model, start 1 of {STARTS}: {rms_error(first, target):.2f} × noise")
    if lead_astray(first, target):
        return BaseFit(first, (rms_error(first, target),), False, "larger physics steps led it astray")
    few = _few_grasps(target)
    small = Subset(target, few, first)
    contact_estimate = guess(small.target, small.problem)
    starts = [small.known, *(_random_start(small.problem, contact_estimate, rng) for _ in range(1, STARTS))]
    ends = side_by_side([partial(small.fit, start) for start in starts])
    for number, end in enumerate(ends[1:], 2):
        progress(f"base model, start {number} of {STARTS}, on a few grasps: {end.error:.2f} × noise")
    if not _agree(ends, small.target):
        progress(f"base model: the starts end in different places; up to {MOST_STARTS} are tried")
    while len(ends) < MOST_STARTS and not _agree(ends, small.target):
        ends.append(small.fit(_random_start(small.problem, contact_estimate, rng)))
        progress(f"base model, start {len(ends)} of {MOST_STARTS}, on a few grasps: {ends[-1].error:.2f} × noise")
    best = min(ends, key=lambda end: end.cost)
    errors = tuple(end.error for end in ends)
    tolerance, noise = cost_tolerance(best, small.target), small.target.cost_of_noise
    # another start found a better place, or this one went on: a fit of all grasps had stopped short
    again = None
    if ends[0].cost - best.cost > tolerance or small.cost - best.cost > max(tolerance, _WENT_ON * (small.cost - noise)):
        again = fit_once(target, problem, simulators, small.enlarge(best.vector))
        first = min([first, again], key=lambda fit: fit.cost)
    agree = _agree(ends, small.target) or rms_error(first, target) <= _NOISE_ALONE
    if not agree:  # rough fits may stop on their way to the same place; each start counts once
        rough = [again] if again is not None else []
        for end in sorted(ends, key=lambda end: end.cost)[len(rough) : _FINISHED]:
            rough.append(fit_once(target, problem, simulators, small.enlarge(end.vector)))
        whole = [fit_exactly(target, problem, simulators, fit.vector) for fit in rough]
        first, agree = min([first, *whole], key=lambda fit: fit.cost), _agree(whole, target)
        progress(f"base model, the best {_FINISHED} starts to the end: {rms_error(first, target):.2f} × noise")
    if not agree:
        spread = ", ".join(f"{error:.2f}" for error in errors)
        reason = f"the starts end in different places (errors of {spread} × noise)"
        return BaseFit(first, errors, False, reason, starts_agree=False)
    return ended(first, target, simulators, errors, hasty)


def ended(
    fit: Fit, target: Target, simulators: Simulators, errors: tuple[float, ...] = (), hasty: bool = False
) -> BaseFit:
    """A fit with whether it converged, brought to its end if it had not; in haste only where little is left."""
    checked = check_gradient(fit, target, errors)
    if checked.converged:
        return checked
    if hasty and rms_error(fit, target) > _MUCH:
        return dataclasses.replace(checked, unfinished=True)
    return finished(checked, target, simulators)


def finished(base: BaseFit, target: Target, simulators: Simulators) -> BaseFit:
    """A fit whose slopes have not vanished yet, brought to its end."""
    first, errors, problem = base.fit, base.errors, base.fit.problem
    # the cheap model's slopes may lead no further where the model itself still falls
    further = check_gradient(fit_exactly(target, problem, simulators, first.vector), target, errors)
    if not further.converged and not simulators.one_model:
        exact = Simulators(problem, exact=True)
        further = check_gradient(fit_exactly(target, problem, exact, first.vector), target, errors)
    if further.converged:
        return further
    # nor may slopes over small steps, where a finger sticks and slips
    simulators.step = LARGE_STEP
    smooth = check_gradient(fit_exactly(target, problem, simulators, further.fit.vector), target, errors)
    if smooth.converged:
        return smooth
    if further.fit.cost - smooth.fit.cost > cost_tolerance(smooth.fit, target):
        return _settle(smooth, target, simulators)
    simulators.step = STEP
    return _settle(further, target, simulators)


def _settle(base: BaseFit, target: Target, simulators: Simulators) -> BaseFit:
    """A fit that goes on by ever shorter steps, and whether it ends so."""
    for _ in range(_SETTLING):
        before = base.fit
        fit = fit_exactly(target, before.problem, simulators, before.vector, patient=True)
        base = check_gradient(fit, target, base.errors)
        if base.converged:
            break
        if before.cost - fit.cost <= cost_tolerance(fit, target):
            slopes = f"slopes of {fit.gradient:.1f} standard errors"
            reason = f"no step lowers the error where the fit ended, though {slopes} say so"
            return dataclasses.replace(base, reason=reason, settled=True)
    return base


def cost_tolerance(best: Fit | End, target: Target) -> float:
    """Difference of two costs that mean the same place."""
    return max(_SAME_SHARE * best.cost, _SAME_COST * target.readings)


def _agree(ends: Sequence[Fit | End], target: Target) -> bool:
    """Whether two fits at least ended in the best place."""
    best = min(ends, key=lambda end: end.cost)
    tolerance = max(cost_tolerance(best, target), _SAME_BEYOND * (best.cost - target.cost_of_noise))
    return sum(end.cost - best.cost <= tolerance for end in ends) >= 2


def check_gradient(fit: Fit, target: Target, errors: tuple[float, ...] = ()) -> BaseFit:
    """Whether one fit converged: projected gradient of at most 5 standard errors."""
    if fit.gradient > _MAX_GRADIENT * max(1.0, float(np.sqrt(fit.cost / target.readings))):
        reason = f"the error still falls where the fit ended (slope of {fit.gradient:.1f} standard errors)"
        return BaseFit(fit, errors, False, reason)
    return BaseFit(fit, errors, True)


def rms_error(fit: Fit, target: Target) -> float:
    """Root mean square of a fit's residuals ÷ noise; of several recordings as :func:`rms` has it."""
    return rms(fit.residual, target)


def _random_start(problem: Problem, contact_estimate: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """A random place inside the bounds; but objects stay where contacts put them, or there is nothing to fit."""
    anywhere = problem.low + rng.uniform(0.2, 0.8, len(contact_estimate)) * (problem.high - problem.low)
    geometry = np.array([e.effect is None and e.parameter in ("radius_m", "offset_m") for e in problem.entries])
    return np.where(geometry, contact_estimate, anywhere)


def _few_grasps(target: Target) -> np.ndarray:
    """The first grasps of each object."""
    seen: dict[str, int] = {}
    chosen = []
    for index, grasp in enumerate(target.grasps):
        seen[grasp.object] = seen.get(grasp.object, 0) + 1
        if seen[grasp.object] <= _GRASPS_PER_OBJECT:
            chosen.append(index)
    return np.array(chosen)


@dataclass(frozen=True)
class End:
    """Where a start ended."""

    vector: np.ndarray  #: coordinates
    cost: float  #: as of :class:`Fit`
    error: float  #: rms residual ÷ noise


class Subset:
    """The same problem on some of its grasps, with the cheap model corrected as in a fit of all of them."""

    def __init__(self, target: Target, keep: np.ndarray, fitted: Fit) -> None:
        self.target, part = target.subset(keep), fitted.subset(keep)
        self.cost = part.cost  #: of the fit of all grasps, on these
        self.problem, self.known, self._correction = part.problem, part.vector, part.correction
        self._simulators = Simulators(self.problem)
        self._fitted = fitted

    def fit(self, start: np.ndarray) -> End:
        vector, residual = descend_roughly(self.target, self.problem, self._simulators, start, self._correction)
        cost = float(np.sum((self.target.weight * residual) ** 2)) + self.problem.priors.cost(vector)
        return End(vector, cost, rms(residual, self.target))

    def enlarge(self, part: np.ndarray) -> np.ndarray:
        """Coordinates for the whole problem: what these grasps don't fix stays as it was."""
        return self._fitted.moved(self.problem, part)
