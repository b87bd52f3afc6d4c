"""Finds out which physical effects a model lacks, one after the other, on evidence from grasps held out of the fit."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from forcegrasp.diagnosis import families
from forcegrasp.diagnosis.cut_short import REASONS, cut_short
from forcegrasp.diagnosis.evidence import LEAST_SHARE_TOGETHER
from forcegrasp.diagnosis.faults.odd_grasps import odd_grasps
from forcegrasp.diagnosis.few import with_few
from forcegrasp.diagnosis.result import Diagnosis, Step, kept_steps
from forcegrasp.diagnosis.search.at_once import AtOnce
from forcegrasp.diagnosis.search.conclusion import Begun, concluded
from forcegrasp.diagnosis.search.exchange import exchange
from forcegrasp.diagnosis.search.left_over import (
    AS_GOOD_AS_NOTHING,
    is_worth_looking,
    leaves_forms,
    leaves_little,
    leaves_more_than_noise,
    left_over,
    may_lack_something,
)
from forcegrasp.diagnosis.search.look_beside import look_beside
from forcegrasp.diagnosis.search.merge import merge
from forcegrasp.diagnosis.search.needless import chained, drop_needless, drop_needless_of_many, simplify
from forcegrasp.diagnosis.search.screen import Screen
from forcegrasp.diagnosis.search.several import most_gained_by_one, usual_on_few
from forcegrasp.diagnosis.search.so_far import SoFar
from forcegrasp.diagnosis.search.split import split
from forcegrasp.diagnosis.search.stalled_base import better_without
from forcegrasp.diagnosis.search.step import look_further
from forcegrasp.diagnosis.search.stop_when import AT_ITS_END, StopWhen
from forcegrasp.diagnosis.search.to_the_end import FAR
from forcegrasp.diagnosis.study import Study
from forcegrasp.diagnosis.verdict import EXPLAINED, EXPLAINED_FAR, MUCH, explained_share
from forcegrasp.effects import Effect
from forcegrasp.identify.base_fit import BaseFit, rms_error
from forcegrasp.identify.cross_validation import evidence_folds, make_folds
from forcegrasp.identify.fit import Fit
from forcegrasp.identify.larger_steps import with_larger_steps_again
from forcegrasp.identify.noise_floor import beyond_fit, numerical_error, numerical_floor
from forcegrasp.identify.progress import Progress, silent
from forcegrasp.identify.simulators import Simulators
from forcegrasp.identify.target import Target
from forcegrasp.identify.verdict import Verdict
from forcegrasp.identify.weights import reweigh

# What is left within the forms of what was found may be another effect's if that explains so much of it, on few grasps
# and then on held-out ones, unless it leaves nothing there.
_OF_ANOTHER = 0.5
# Beyond so many times the noise effects whose signatures promise little are not fitted; contacts, with which a base fit
# makes up for them, bring it much further off than a servo is.
_FAR_OF_CONTACTS = 3 * FAR
# Where no effect explains half, and all signatures together promise less than this share, what is missing is in no
# catalogue: what several look-alikes take of it says nothing.
_OF_KNOWN = 0.65
#: Largest number of effects that are looked for one by one.
MOST_EFFECTS = 8


def diagnose(
    target: Target,
    base: BaseFit,
    simulators: Simulators,
    effects: Sequence[type[Effect]],
    rng: np.random.Generator,
    progress: Progress = silent,
    start: tuple[Fit, Sequence[Step]] | None = None,
    stop_when: StopWhen = AT_ITS_END,
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
      stop_when: what shortens or ends it beside what it finds.

    Ctrl-C, or the end of a time limit, ends the search with what was found by then.
    """
    first, before = (base.fit, ()) if start is None else start
    numerical = numerical_error(first, target)
    study = Study(
        target, simulators, evidence_folds(target.grasps), beyond_fit(first, numerical), progress,
        given_explains=stop_when.given_explains,
    )  # fmt: skip
    folds = tuple(make_folds(target.grasps))
    error_before = study.error(target.before_rounding(study.heldout(base.fit)))
    odd = odd_grasps(target, first)
    if any(grasp.like for grasp in odd):  # nothing can be learnt of the gripper until labels are right
        labels = ("object_labels",)
        return Diagnosis(
            Verdict.DATA, labels, (), base, first, target, folds, error_before, error_before, left="labels", odd=odd
        )
    floor = numerical_floor(study.numerical, target)
    begun = Begun(base, first, numerical, odd, folds, error_before, floor, effects)
    steps = list(before)
    if (rounding := target.rounding) is not None and start is None:
        progress(f"found {rounding.effect.name}: readings are multiples of one step")
        steps.append(Step((rounding.effect.name,), (), (), error_before, study.error(study.heldout(first))))
    so_far = SoFar((study, steps, first))
    try:
        if (may_lack_something if start is None else is_worth_looking)(study, first):
            better = _add_effects(so_far, begun, rng, stop_when)
            if better is not None:
                progress(f"without it the model fits as well from there: {rms_error(better, target):.2f} × noise")
                if start is None:
                    base = dataclasses.replace(base, fit=better)
                else:
                    start = better, before
                return diagnose(target, base, simulators, effects, rng, progress, start, stop_when)
        if so_far.given_first:
            return concluded(begun, *so_far.all, in_a_hurry=True)
        study, _, fit = so_far.all
        if stop_when.goes_on and left_over(study, fit)[0]:
            return concluded(begun, *so_far.sure, in_a_hurry=True)
        _tidy_up(so_far, begun)
        found = _believed(so_far, begun)
        if start is None and found.base.fit is not base.fit:
            progress(f"further on the base model leaves less: {rms_error(found.base.fit, target):.2f} × noise")
            return diagnose(target, found.base, simulators, effects, rng, progress, start, stop_when)
        return found
    except REASONS as reason:
        stopped = cut_short(reason, progress)
        study, steps, fit = so_far.sure
        found = concluded(begun, study, steps, fit, in_a_hurry=True)
        return dataclasses.replace(found, stopped=stopped, leads=study.leads.beside(fit))


def _add_effects(so_far: SoFar, begun: Begun, rng: np.random.Generator, stop_when: StopWhen) -> Fit | None:
    """Adds one effect after the other; or returns a better fit without any, where the one to begin with had stalled."""
    effects = begun.effects
    study, steps, fit = so_far.all
    screen, screened, tried_anyway = Screen(effects, study), fit, False
    several = AtOnce(so_far, begun, rng, stop_when.given_first)
    for _ in range(MOST_EFFECTS):
        if several.given_is_first(study, fit):
            study.progress("what the set gives explains most of what is left, moved by a little")
            so_far.given_first = True
            break
        others, richer = left_to_try(effects, fit, steps), list(families.extensions(fit, effects))
        little = leaves_little(study, fit, begun.error, begun.floor)
        forms = little or begun.may_be_forms(study, fit)  # what explains a part of it could not be told from those
        untried = () if several.done else others
        if not (untried or richer or forms) or (several.done and begun.left(study, fit) > MUCH):
            break  # with a dozen effects and much left, all that could be asked takes long and says little
        study = with_few(study, fit)
        if forms:  # nor could those of one family, which act alike
            own = {one.effect.family for one in fit.problem.effects}
            untried = [effect for effect in untried if effect.family not in own]
        if forms and not (untried and _may_be_another(study, fit, screen, untried)):
            study.progress("what is left may be the form of what was found: no other effect explains half of it")
            untried = ()
        if several.that_add_up(study, steps, fit, screen, untried) or (
            several.are_likely(study, fit, screen, untried) and several.found(study, steps, fit, EXPLAINED)
        ):
            _, steps, fit = so_far.all
            continue
        alone, several.alone = several.alone, ()
        step = look_further(study, fit, screen, alone, rng, anyway=True) if alone else None
        least_together = 0.0 if fit.problem.effects or study.target.gripper.is_servo else _OF_KNOWN
        if step is None or not step.effects:
            most = stop_when.most if fit is begun.fit else np.inf
            step = look_further(study, fit, screen, untried, rng, richer, most, least_together=least_together)
        step = _of_another(step, study) if forms else step
        # what is on trial has no look-alikes that are worth the time, and what was found together takes too long
        much = (step.of_many or not step.effects) and so_far.believed is None and not several.done
        much = much and step.error_before > AS_GOOD_AS_NOTHING * begun.floor
        much = much and not stop_when.may_be_given(study.target, fit)
        if much and untried and screened is not fit:  # beside what was found since, others may do something else
            screen, screened = Screen(effects, study), fit
            step = look_further(study, fit, screen, untried, rng, before=step.candidates)
            step = _of_another(step, study) if forms else step
        much = much and not step.effects and not leaves_forms(study, fit, begun.error, begun.floor)
        # of what seems to be stronger noise, beside what was found, signatures say enough
        much = much and (fit is begun.fit or leaves_more_than_noise(study, fit))
        if much:
            far = FAR if study.target.gripper.is_servo else _FAR_OF_CONTACTS
            worth_it = untried and not tried_anyway and step.error_before < far
            found = _fitted_anyway(study, fit, screen, untried, rng, least_together) if worth_it else None
            found = found or exchange(study, fit, screen, others, steps, rng)
            two = None if found or forms else split(study, fit, screen, untried, steps, rng)
            steps, step = two or (steps, found or step)
            tried_anyway = True  # it takes long, and where it has helped signatures lead on
        if much and untried and not step.effects and several.found(study, steps, fit, EXPLAINED_FAR):
            _, steps, fit = so_far.all
            continue
        if not step.effects:
            so_far.all = study, [*steps, step], fit
            break
        if step.of_many and so_far.believed is None:
            nothing = dataclasses.replace(step, effects=(), error_after=step.error_before)
            so_far.believed = study, [*steps, nothing], fit
        best = step.candidates[0]
        of_base = fit is begun.fit and not best.replaces
        if of_base and (better := better_without(best.effect.name, best.fit, fit, study)) is not None:
            return better
        study.progress(
            f"found {step.effects[0]}: held-out error {step.error_before:.2f} → {step.error_after:.2f} × noise"
        )
        target, fit = reweigh(study.target, best.fit, study.simulators)
        if target is not study.target:
            study = dataclasses.replace(study, target=target)
        step, fit = drop_needless(study, step, fit, begun.given)
        steps = [*steps, step]
        study, fit = _with_larger_steps(study, fit)
        so_far.all = study, steps, fit
        little = study.target.gripper.is_servo and leaves_little(study, fit, begun.error, begun.floor)
        if little or not is_worth_looking(study, fit):
            break
    return None


def _with_larger_steps(study: Study, fit: Fit) -> tuple[Study, Fit]:
    """Both with larger physics steps, if the base fit bore none and what was found since does; else as they are."""
    if not study.target.gripper.own_steps or (again := with_larger_steps_again(fit, study.target)) is None:
        return study, fit
    study.progress("from here on grasps go the same way with larger physics steps")
    target, simulators, fit = again
    return dataclasses.replace(study, target=target, simulators=simulators, few=None, rough=None), fit


def _may_be_another(study: Study, fit: Fit, screen: Screen, effects: Sequence[type[Effect]]) -> bool:
    """Whether one of these effects alone explains so much of what may be forms that it is another one."""
    least = _OF_ANOTHER * usual_on_few(study, fit)
    return most_gained_by_one(study, fit, screen, effects, least) > least


def _of_another(step: Step, study: Study) -> Step:
    """A step from what may be forms: it found nothing if too much is left for it to be another effect's."""
    best = step.candidates[0] if step.effects else None
    if best is None or best.replaces or best.share > _OF_ANOTHER or not left_over(study, best.fit)[0]:
        return step
    return dataclasses.replace(step, effects=(), error_after=step.error_before)


def _tidy_up(so_far: SoFar, begun: Begun) -> None:
    """Leaves out and puts together what can be, now that all is found, and fits effects that jump once more."""
    study, steps, fit = so_far.all
    if len(fit.problem.effects) <= MOST_EFFECTS:  # a dozen make 66 pairs; what they do not need was left out already
        steps, fit = simplify(study, steps, fit, begun.given)
        so_far.all = study, steps, fit
        steps, fit = merge(study, steps, fit, begun.effects, begun.given)
        so_far.all = study, steps, fit
    steps, fit = drop_needless_of_many(study, steps, fit, begun.given)
    so_far.all = study, steps, fit
    so_far.all = study, *_look_beside_all(study, steps, fit)


def _believed(so_far: SoFar, begun: Begun) -> Diagnosis:
    """What all that was found adds up to; or what is sure of it, where the rest explains too little."""
    study, steps, fit = so_far.all
    found = concluded(begun, study, steps, fit)
    if so_far.believed is None:
        return found
    before, _, fewer = so_far.believed
    if _convincing(before, fewer, study, found.fit):  # which may have another effect than the search ended with
        return found
    return dataclasses.replace(concluded(begun, *so_far.believed), bolder=found)


def _fitted_anyway(
    study: Study, fit: Fit, screen: Screen, effects: Sequence[type[Effect]], rng: np.random.Generator,
    least_together: float,
) -> Step | None:  # fmt: skip
    """A step with an effect whose signature promised too little; None if there is none."""
    step = look_further(study, fit, screen, effects, rng, anyway=True, least_together=least_together)
    return step if step.effects else None


def _look_beside_all(study: Study, steps: Sequence[Step], fit: Fit) -> tuple[list[Step], Fit]:
    """The steps and a fit from better sizes of effects that jump: what was found later may have moved them."""
    further = fit
    for place in range(len(fit.problem.effects)):
        further = look_beside(further, study.target, study.simulators, place)
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
    return not left_over(study, fit)[0] or explained_share(error, left) >= LEAST_SHARE_TOGETHER
