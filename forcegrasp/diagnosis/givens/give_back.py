"""Takes back what a set was moved by, where an effect that was found only then does without it."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from forcegrasp.diagnosis.evidence import LEAST_LEAD, is_beyond_chance
from forcegrasp.diagnosis.families import roughly_without
from forcegrasp.diagnosis.faults.odd_grasps import coordinates_by_name
from forcegrasp.diagnosis.few import with_few
from forcegrasp.diagnosis.givens.moved_set import SearchOn, one_after_the_other
from forcegrasp.diagnosis.result import Diagnosis, Step, kept_steps
from forcegrasp.diagnosis.search.needless import drop_all_needless
from forcegrasp.diagnosis.study import Study
from forcegrasp.effects.object_size import ObjectSize
from forcegrasp.identify.cross_validation import evidence_folds
from forcegrasp.identify.fit import Fit, fit_exactly
from forcegrasp.identify.noise_floor import beyond_fit
from forcegrasp.identify.problem import Problem
from forcegrasp.identify.progress import Progress
from forcegrasp.identify.simulators import Simulators


def without_move(
    moved: Diagnosis, found: Diagnosis, search_on: SearchOn, progress: Progress
) -> tuple[Diagnosis, Simulators] | None:
    """The diagnosis of the set as it is with the effects that were found once it was moved; None if the move is needed.

    What is missing may look like radii that are a little off, and so much of it be taken by them that the rest shows
    the effect. With that in the model an error of all sizes would only take the move back.

    Args:
      moved: the diagnosis of the set as moved.
      found: of the set as it is, before.
      search_on: looks for further effects.
      progress: told what is going on.
    """
    fault, names = moved.fault, {one.effect.name for one in moved.fit.problem.effects} - {ObjectSize.name}
    before = {one.effect.name for one in found.fit.problem.effects}
    if fault is None or fault.moved is None or moved.stopped or not names - before:
        return None
    effects = [one for one in moved.fit.effects if one.effect.name in names]
    target = found.target
    problem = Problem(moved.fit.problem.gripper, target.grasps, effects)
    simulators = Simulators(problem)
    progress("fitting what was found without moving what the set gives")
    start = coordinates_by_name(problem, (moved.fit.problem, moved.fit.vector))
    fit = fit_exactly(target, problem, simulators, start)
    study = Study(target, simulators, evidence_folds(target.grasps), beyond_fit(fit, found.numerical), progress)
    gains = study.gains(study.heldout(fit), study.heldout(moved.fit))  # of the move, and of a size beside it
    if is_beyond_chance(gains - fault.moved.price / len(gains), LEAST_LEAD):
        return None
    study = with_few(study, fit)
    steps = [dataclasses.replace(one, effects=one.effects[:1], candidates=one.candidates[:1])
             for one in kept_steps(moved.steps) if one.is_counted or one.effects[0] in names]  # fmt: skip
    steps, fit = drop_all_needless(study, steps, fit, len(found.base.fit.problem.effects))
    steps, bare = one_after_the_other(study, _by_what_absence_costs(study, steps, fit), fit)
    return search_on(target, simulators, dataclasses.replace(found.base, fit=bare), fit, steps), simulators


def _by_what_absence_costs(study: Study, steps: Sequence[Step], fit: Fit) -> list[Step]:
    """The steps, those first whose effect the others do least without: some were found before it, in its place."""
    costs = {
        one.effects[0]: np.inf if one.is_counted else roughly_without(one.effects[0], fit, study, at_the_end=False).cost
        for one in steps
    }
    return sorted(steps, key=lambda one: -costs[one.effects[0]])
