"""Leaves out an effect that one found later made needless: the first to be found may have been its look-alike."""

from __future__ import annotations

import dataclasses

from forcegrasp.diagnosis.evidence import LEAST_RISE, is_beyond_chance
from forcegrasp.diagnosis.families import refit_without
from forcegrasp.diagnosis.result import Step
from forcegrasp.diagnosis.study import Study
from forcegrasp.identify.cross_validation import rms
from forcegrasp.identify.fit import Fit


def drop_needless(study: Study, step: Step, fit: Fit, given: int) -> tuple[Step, Fit]:
    """The step, whose effect takes the place of an earlier one if held-out grasps no longer ask for that.

    Args:
      study: the measurements.
      step: that found the last effect of the fit.
      fit: with all effects.
      given: number of effects that were in the model before the search; they stay.
    """
    held = study.heldout(fit)
    without: dict[str, tuple[Fit, float]] = {}
    for one in fit.problem.effects[given:-1]:
        study.progress(f"fitting without {one.effect.name}")
        less = refit_without(one.effect.name, fit, study)
        left = study.heldout(less)
        if not is_beyond_chance(study.gains(left, held), LEAST_RISE):
            without[one.effect.name] = less, rms(left, study.target)
    if not without:
        return step, fit
    name, (less, error) = min(without.items(), key=lambda item: item[1][0].cost)
    study.progress(f"{name} is needless with {step.effects[0]}")
    last = dataclasses.replace(
        step.candidates[0],
        setting=less.problem.case(less.vector).effects[-1],
        fit=less,
        error_after=error,
        replaces=name,
    )
    return dataclasses.replace(step, candidates=(last, *step.candidates[1:]), error_after=error), less
