"""Puts right what a set gives and is seen to be wrong only once the effects are known that had hidden it."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

from forcegrasp.diagnosis.faults.suspects import Fault, suspects
from forcegrasp.diagnosis.few import with_few
from forcegrasp.diagnosis.givens.doubt import with_fault
from forcegrasp.diagnosis.givens.moved_set import SearchOn, one_after_the_other
from forcegrasp.diagnosis.result import Diagnosis, kept_steps
from forcegrasp.diagnosis.study import Study
from forcegrasp.diagnosis.verdict import MUCH
from forcegrasp.identify.base_fit import BaseFit
from forcegrasp.identify.cross_validation import evidence_folds
from forcegrasp.identify.loading import Loaded
from forcegrasp.identify.noise_floor import beyond_fit
from forcegrasp.identify.progress import Progress
from forcegrasp.identify.simulators import Simulators
from forcegrasp.identify.target import Target
from forcegrasp.measure import MeasurementSet

#: A set lined up, what simulates its grasps, and a model that was fitted to it.
Fitted = tuple[Target, Simulators, BaseFit]
#: Fits a model with the effects that were found to the set put right; None unless that leaves much less.
PutRight = Callable[[Fault, Fitted], tuple[Fault, Fitted] | None]


def with_givens_put_right(
    found: Diagnosis, loaded: Loaded[MeasurementSet], put_right: PutRight, search_on: SearchOn, progress: Progress,
    least: float = MUCH,
) -> tuple[Diagnosis, Simulators] | None:  # fmt: skip
    """The diagnosis with radii, or a recording's setting, put right beside effects; None if little is left, or a tie.

    Args:
      found: of the set as it is.
      loaded: the set.
      put_right: fits the effects that were found to the set without the fault.
      search_on: looks for further effects.
      progress: told what is going on.
      least: error ÷ floor from which on it is asked.
    """
    steps = kept_steps(found.steps)
    plain = bool(steps) and all(len(step.effects) == 1 and step.candidates for step in steps)
    little = not found.left or found.error_after < least * found.floor
    if not plain or little or found.fault is not None or found.stopped:
        return None
    said = found.target, Simulators(found.fit.problem), dataclasses.replace(found.base, fit=found.fit)
    for fault in suspects(loaded, found.target, found.fit):
        if not fault.fitted or (better := put_right(fault, said)) is None:
            continue
        fault, (target, simulators, base) = better
        numerical = beyond_fit(base.fit, found.numerical)
        study = with_few(Study(target, simulators, evidence_folds(target.grasps), numerical, progress), base.fit)
        first = [dataclasses.replace(step, candidates=step.candidates[:1]) for step in steps]
        first, bare = one_after_the_other(study, first, base.fit)
        again = search_on(target, simulators, dataclasses.replace(base, fit=bare), base.fit, first)
        if fault.is_borne_out(again.fit):
            return with_fault(again, fault.told_by(again.fit), (found.target, found.base.fit)), simulators
    return None
