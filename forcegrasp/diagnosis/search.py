"""Finds out which physical effects a model lacks, one after the other, on evidence from grasps held out of the fit."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from forcegrasp.diagnosis import families
from forcegrasp.diagnosis.ask_again import ask_again
from forcegrasp.diagnosis.evidence import LEAST_SHARE_TOGETHER, with_close_rivals
from forcegrasp.diagnosis.exchange import exchange
from forcegrasp.diagnosis.few import with_few
from forcegrasp.diagnosis.look_beside import look_beside
from forcegrasp.diagnosis.merge import merge
from forcegrasp.diagnosis.needless import chained, drop_needless, simplify
from forcegrasp.diagnosis.noise_check import Noise, unexpected_noise
from forcegrasp.diagnosis.odd_grasps import OddGrasp, odd_grasps
from forcegrasp.diagnosis.result import Diagnosis, Step, kept_steps, settle_ties
from forcegrasp.diagnosis.screen import Screen
from forcegrasp.diagnosis.split import split
from forcegrasp.diagnosis.step import FAR, look_further
from forcegrasp.diagnosis.study import Study
from forcegrasp.diagnosis.verdict import EXPLAINED_FAR, MUCH, conclude, explained_share
from forcegrasp.effects import Effect
from forcegrasp.identify.base_fit import BaseFit
from forcegrasp.identify.cross_validation import evidence_folds, make_folds, rms_of_grasps
from forcegrasp.identify.fit import Fit, Simulators
from forcegrasp.identify.noise_floor import beyond_fit, excess, numerical_error, numerical_floor
from forcegrasp.identify.progress import Progress, silent
from forcegrasp.identify.target import Target
from forcegrasp.identify.verdict import Verdict
from forcegrasp.identify.weights import reweigh

#: Largest number of effects that are looked for.
MOST_EFFECTS = 8
# Of so many grasps one alone says nothing of the gripper: where fingers push an object is a matter of chance.
_MANY = 12
# Where the base fit stopped short, parameters are a little off: so many times the floor is as good as nothing left.
_AS_GOOD_AS_NOTHING = 1.1
# If that is also less than this share of what was beyond the floor, effects that were found are nearly right, and what
# takes the rest makes up for their forms: behind a lag, in another engine's contacts, objects were ten times too light.
_LITTLE = 0.1


def diagnose(
    target: Target,
    base: BaseFit,
    simulators: Simulators,
    effects: Sequence[type[Effect]],
    rng: np.random.Generator,
    progress: Progress = silent,
    start: tuple[Fit, Sequence[Step]] | None = None,
    may_be_given: Callable[[Target, Fit], bool] | None = None,
) -> Diagnosis:
    """Adds effects to a fitted base model for as long as the evidence holds.

    Args:
      target: the measurements.
      base: the fitted base model, possibly with effects already in it.
      simulators: of the same grasps.
      effects: the catalogue.
      rng: for the null distribution.
      progress: told what is going on.
      start: a fit with the effects that steps have found before, to go on from; the base model by default.
      may_be_given: whether what the set gives, moved within its tolerance, may explain what a fit leaves: then effects
        that promise too little are not fitted.
    """
    first, before = (base.fit, ()) if start is None else start
    fit = first
    numerical = numerical_error(fit, target)
    study = Study(target, simulators, evidence_folds(target.grasps), beyond_fit(fit, numerical), progress)
    folds = tuple(make_folds(target.grasps))
    error_before = study.error(target.before_rounding(study.heldout(base.fit)))
    odd = odd_grasps(target, fit)
    if any(grasp.like for grasp in odd):  # nothing can be learnt of the gripper until labels are right
        labels = ("object_labels",)
        return Diagnosis(
            Verdict.DATA, labels, (), base, fit, target, folds, error_before, error_before, left="labels", odd=odd
        )
    floor = numerical_floor(study.numerical, target)
    steps: list[Step] = list(before)
    if (rounding := target.rounding) is not None and start is None:
        progress(f"found {rounding.effect.name}: readings are multiples of one step")
        steps.append(Step((rounding.effect.name,), (), (), error_before, study.error(study.heldout(fit))))
    screen, screened, tried_anyway = Screen(effects, study), fit, False
    believed: tuple[list[Step], Fit, Study] | None = None  # what is, if the rest explains too little in the end
    for _ in range(MOST_EFFECTS if start is None or _is_worth_looking(study, fit) else 0):
        untried = left_to_try(effects, fit, steps)
        richer = list(families.extensions(fit, effects))
        if not untried and not richer:
            break
        study = with_few(study, fit)
        step = look_further(study, fit, screen, untried, rng, richer)
        # what is on trial has no look-alikes that are worth the time
        much = not step.effects and believed is None and step.error_before > _AS_GOOD_AS_NOTHING * floor
        much = much and not (may_be_given is not None and may_be_given(target, fit))
        if much and screened is not fit:  # beside what was found since, others may do something else
            screen, screened = Screen(effects, study), fit
            step = look_further(study, fit, screen, untried, rng, richer)
        if much and not step.effects:
            worth_it = not tried_anyway and step.error_before < FAR
            found = _fitted_anyway(study, fit, screen, untried, rng) if worth_it else None
            found = found or exchange(study, fit, screen, untried, steps, rng)
            two = None if found else split(study, fit, screen, untried, steps, rng)
            steps, step = two or (steps, found or step)
            tried_anyway = True  # it takes long, and where it has helped signatures lead on
        if not step.effects:
            steps.append(step)
            break
        if step.of_many and believed is None:
            nothing = dataclasses.replace(step, effects=(), error_after=step.error_before)
            believed = [*steps, nothing], fit, study
        progress(f"found {step.effects[0]}: held-out error {step.error_before:.2f} → {step.error_after:.2f} × noise")
        weighed, fit = reweigh(target, step.candidates[0].fit, simulators)
        if weighed is not target:
            target, study = weighed, dataclasses.replace(study, target=weighed)
        step, fit = drop_needless(study, step, fit, len(base.fit.problem.effects))
        steps.append(step)
        if not _is_worth_looking(study, fit) or _leaves_little(study, fit, error_before, floor):
            break
    steps, fit = simplify(study, steps, fit, len(base.fit.problem.effects))
    steps, fit = merge(study, steps, fit, effects, len(base.fit.problem.effects))
    steps, fit = _look_beside_all(study, steps, fit, simulators)
    begun = _Begun(base, first, numerical, odd, folds, error_before, floor, effects)
    found = _concluded(begun, study, steps, fit)
    if believed is None or _convincing(believed[2], believed[1], study, fit):
        return found
    steps, fit, study = believed
    return dataclasses.replace(_concluded(begun, study, steps, fit), bolder=found)


@dataclass(frozen=True, eq=False)
class _Begun:
    """What a search began with."""

    base: BaseFit
    fit: Fit
    numerical: tuple[np.ndarray, ...]
    odd: tuple[OddGrasp, ...]
    folds: tuple[np.ndarray, ...]
    error: float
    floor: float
    effects: Sequence[type[Effect]]


def _concluded(begun: _Begun, study: Study, steps: Sequence[Step], fit: Fit) -> Diagnosis:
    """What the steps of a search, and a fit with all effects that they found, add up to."""
    base, target, floor, error_before = begun.base, study.target, begun.floor, begun.error
    error_after, (left, noise, alone) = study.error(study.heldout(fit)), _left_by_many(study, fit)
    much_left = bool(left) and error_after > MUCH * floor
    steps = settle_ties([with_close_rivals(step) for step in steps] if much_left else steps)
    if not much_left:  # what is still missing could decide between them again
        steps, asked = ask_again(study, steps, fit, begun.effects if error_after > floor else ())
        if asked is not fit:
            fit = asked
            error_after, (left, noise, alone) = study.error(study.heldout(fit)), _left_by_many(study, fit)
    found = kept_steps(steps)
    only_of_set = all(s.candidates and s.candidates[0].effect.of_set for s in found)
    share = study.explained(target.before_rounding(study.heldout(base.fit)), study.heldout(fit))
    # a missing effect makes the error rough, and the base fit stop short: then what leaves more may be a look-alike
    leaves_more = bool(left) and error_after > _AS_GOOD_AS_NOTHING * floor and share < EXPLAINED_FAR
    if not base.converged and (not found or leaves_more):
        return Diagnosis(
            Verdict.NOT_FITTED, (), (), base, base.fit, target, begun.folds, error_before, error_before, odd=begun.odd
        )
    verdict = conclude(
        [s.verdict for s in found if s.verdict],
        share,
        error_after,
        floor,
        bool(left),
        only_of_set,
        whole_recordings=len(target.recordings) > 1,
    )
    names = [s.effects[0] for s in found] if verdict.names_effects else []
    if verdict is Verdict.ONE_OF:
        names += [name for s in found for name in s.effects[1:]]
    numerical, odd = begun.numerical, begun.odd
    if fit is not begun.fit:  # what was missing may have made them odd
        numerical, odd = numerical_error(fit, target), odd_grasps(target, fit)
    return Diagnosis(
        verdict, tuple(dict.fromkeys(names)), tuple(steps), base, fit, target, begun.folds, error_before, error_after,
        numerical, floor, left, odd, noise, alone=alone,
    )  # fmt: skip


def _fitted_anyway(
    study: Study, fit: Fit, screen: Screen, effects: Sequence[type[Effect]], rng: np.random.Generator
) -> Step | None:
    """A step with an effect whose signature promised too little; None if there is none."""
    step = look_further(study, fit, screen, effects, rng, anyway=True)
    return step if step.effects else None


def _look_beside_all(study: Study, steps: Sequence[Step], fit: Fit, simulators: Simulators) -> tuple[list[Step], Fit]:
    """The steps and a fit from better sizes of effects that jump: what was found later may have moved them."""
    further = fit
    for place in range(len(fit.problem.effects)):
        further = look_beside(further, study.target, simulators, place)
    if further is fit or not kept_steps(steps):
        return list(steps), further
    return chained(steps, study.error(study.heldout(further))), further


def left_to_try(effects: Sequence[type[Effect]], fit: Fit, steps: Sequence[Step]) -> list[type[Effect]]:
    """Those of the effects that a model may still lack.

    Not those in it, nor what they contain or contains them, means nothing beside them, or gave way to one of them.
    """
    known, dropped = {setting.effect for setting in fit.problem.effects}, {step.replaces for step in steps}
    return [e for e in effects if e.name not in dropped and families.may_join(e, known)]


def _convincing(before: Study, fewer: Fit, study: Study, fit: Fit) -> bool:
    """Whether effects that explain little each leave nothing together, or little of what was left before them."""
    error, left = before.error(before.heldout(fewer)), study.error(study.heldout(fit))
    return not _left(study, fit)[0] or explained_share(error, left) >= LEAST_SHARE_TOGETHER


def _left_by_many(study: Study, fit: Fit) -> tuple[str, Noise | None, str]:
    """The same where no single grasp shows it; and what one shows, in words, where all others show noise alone."""
    (left, noise), target = _left(study, fit), study.target
    if not left or target.gripper.is_servo or len(target.grasps) < _MANY:
        return left, noise, ""
    held = study.heldout(fit)
    for index in np.argsort(-np.nansum(held**2, axis=(1, 2))):
        others = held.copy()
        others[index] = np.nan
        noise = unexpected_noise(others, study.numerical, target, fit.predicted)
        if noise is not None or not excess(others, study.numerical, target):
            grasp, error = target.grasps[index], rms_of_grasps(fit.residual, target)[index]
            return "", noise, f"grasp {grasp.name} of {grasp.object} ({error:.2f} × noise)"
    return left, None, ""


def _is_worth_looking(study: Study, fit: Fit) -> bool:
    """Whether a model leaves more than noise, or what seems to be stronger noise: only that none is found tells."""
    left, noise = _left(study, fit)
    return bool(left) or (noise is not None and noise.stronger)


def _leaves_little(study: Study, fit: Fit, error_before: float, floor: float) -> bool:
    """Whether effects leave next to nothing, and little of what there was before them."""
    error = study.error(study.heldout(fit))
    return error < _AS_GOOD_AS_NOTHING * floor and explained_share(error_before, error, noise=floor) > 1 - _LITTLE


def _left(study: Study, fit: Fit) -> tuple[str, Noise | None]:
    """Where held-out residuals are more than noise, in words; and the noise, if it is not as assumed."""
    held = study.heldout(fit)
    noise = unexpected_noise(held, study.numerical, study.target, fit.predicted)
    # where a fit of all grasps leaves nothing no effect is missing, nor is noise larger: others say too little of a
    # held-out one's object, or with their parameters it goes another way
    if not excess(fit.residual, study.numerical, study.target):
        return "", None if noise and noise.stronger else noise
    return ("" if noise else excess(held, study.numerical, study.target)), noise
