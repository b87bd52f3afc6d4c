"""What the steps of a search for missing effects add up to."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from forcegrasp.diagnosis.evidence import with_close_rivals
from forcegrasp.diagnosis.faults.odd_grasps import OddGrasp, odd_grasps
from forcegrasp.diagnosis.result import Diagnosis, Step, falls_by_effect, kept_steps, settle_ties
from forcegrasp.diagnosis.search.ask_again import ask_again
from forcegrasp.diagnosis.search.forms import may_be_forms
from forcegrasp.diagnosis.search.left_over import AS_GOOD_AS_NOTHING, left_by_many
from forcegrasp.diagnosis.study import Study
from forcegrasp.diagnosis.verdict import EXPLAINED_FAR, MUCH, conclude, explained_share
from forcegrasp.effects import Effect
from forcegrasp.identify.base_fit import BaseFit, check_gradient, cost_tolerance, finished
from forcegrasp.identify.fit import Fit
from forcegrasp.identify.noise_floor import numerical_error
from forcegrasp.identify.verdict import Verdict


@dataclass(frozen=True, eq=False)
class Begun:
    """What a search began with."""

    base: BaseFit
    fit: Fit
    numerical: tuple[np.ndarray, ...]
    odd: tuple[OddGrasp, ...]
    folds: tuple[np.ndarray, ...]
    error: float
    floor: float
    effects: Sequence[type[Effect]]

    @property
    def given(self) -> int:
        """Number of effects that were in the model before the search; they stay."""
        return len(self.base.fit.problem.effects)

    def left(self, study: Study, fit: Fit) -> float:
        """Error that a fit leaves of held-out grasps ÷ the floor."""
        return study.error(study.heldout(fit)) / self.floor

    def may_be_forms(self, study: Study, fit: Fit) -> bool:
        """Whether no more is left than effects in the model may be off by that act in another form.

        With those of a given model alone that is not asked: what it leaves is what is to be looked at.
        """
        found_some = len(fit.problem.effects) > self.given
        return found_some and self.left(study, fit) < MUCH and may_be_forms(study, fit)


def concluded(begun: Begun, study: Study, steps: Sequence[Step], fit: Fit, in_a_hurry: bool = False) -> Diagnosis:
    """What the steps of a search, and a fit with all effects that they found, add up to; in a hurry without fits."""
    base, target, floor, error_before = begun.base, study.target, begun.floor, begun.error
    error_after, (left, noise, alone) = study.error(study.heldout(fit)), left_by_many(study, fit)
    much_left = bool(left) and error_after > MUCH * floor
    steps = settle_ties([with_close_rivals(step) for step in steps] if much_left else steps)
    if not much_left and not in_a_hurry:  # what is still missing could decide between them again
        steps, asked = ask_again(study, steps, fit, begun.effects, at_floor=error_after <= floor)
        if asked is not fit:
            fit = asked
            error_after, (left, noise, alone) = study.error(study.heldout(fit)), left_by_many(study, fit)
    found = kept_steps(steps)
    only_of_set = all(s.candidates and s.candidates[0].effect.of_set for s in found)
    share = study.explained(target.before_rounding(study.heldout(base.fit)), study.heldout(fit))
    # a missing effect makes the error rough, and the base fit stop short: then what leaves more may be a look-alike,
    # unless with it the fit came to an end
    beyond_floor = explained_share(error_before, error_after, noise=floor)
    leaves_more = error_after > AS_GOOD_AS_NOTHING * floor and beyond_floor < EXPLAINED_FAR
    led_on = bool(found) and (in_a_hurry or check_gradient(fit, target).converged)  # in a hurry no fit came to its end
    told = not found or leaves_more
    if left and base.unfinished and not (led_on or in_a_hurry) and told:
        base = _finished(base, study)
    # nor is it the fit that is to blame for what no effect explains where no step leads further
    came_to_an_end = base.converged or led_on or ((base.settled or base.unfinished) and not found)
    if left and not came_to_an_end and told:
        return Diagnosis(
            Verdict.NOT_FITTED, (), (), base, base.fit, target, begun.folds, error_before, error_before,
            begun.numerical, odd=begun.odd,
        )  # fmt: skip
    verdict = conclude(
        [s.verdict for s in found if s.verdict],
        share,
        error_after,
        floor,
        bool(left),
        only_of_set,
        whole_recordings=len(target.recordings) > 1,
        largest=None if in_a_hurry else _largest(steps, error_before),
    )
    names = [s.effects[0] for s in found] if verdict.names_effects else []
    if verdict is Verdict.ONE_OF:
        names += [name for s in found for name in s.effects[1:]]
    numerical, odd = begun.numerical, begun.odd
    if fit is not begun.fit:  # what was missing may have made them odd
        numerical, odd = numerical_error(fit, target), odd_grasps(target, fit)
    forms = bool(left) and verdict.names_effects and begun.may_be_forms(study, fit)
    return Diagnosis(
        verdict, tuple(dict.fromkeys(names)), tuple(steps), base, fit, target, begun.folds, error_before, error_after,
        numerical, floor=floor, left=left, odd=odd, noise=noise, alone=alone, may_be_forms=forms,
    )  # fmt: skip


def _largest(steps: Sequence[Step], error: float) -> float:
    """Share of the mean square beyond the noise, with that error, by which it falls most with one effect."""
    return max(falls_by_effect(steps).values(), default=0.0) / max(error**2 - 1.0, 1e-9)


def _finished(base: BaseFit, study: Study) -> BaseFit:
    """The base model's fit, brought to its end; the very same fit if that leads to no other place."""
    study.progress("bringing the fit of the base model to its end")
    end = finished(base, study.target, study.simulators)
    same = base.fit.cost - end.fit.cost <= cost_tolerance(end.fit, study.target)
    return dataclasses.replace(end, fit=base.fit) if same else end
