"""Whether a set with a fault put right is the likelier one, and what that makes of a diagnosis."""

from __future__ import annotations

import dataclasses

import numpy as np

from forcegrasp.diagnosis.evidence import LEAST_LEAD, is_beyond_chance
from forcegrasp.diagnosis.faults.fault import Fault, besides, told_with
from forcegrasp.diagnosis.result import Diagnosis, kept_steps
from forcegrasp.diagnosis.verdict import EXPLAINED_FAR, explained_share
from forcegrasp.identify.cross_validation import (
    heldout_residual,
    log_likelihood,
    log_likelihood_of_sizes,
    make_folds,
    rms,
)
from forcegrasp.identify.fit import Fit
from forcegrasp.identify.target import Target
from forcegrasp.identify.verdict import Verdict

_Fitted = tuple[Target, Fit]


def is_worth_a_search(fault: Fault, right: _Fitted, said: _Fitted) -> bool:
    """Whether the base model of a set put right leaves much less on held-out grasps than that of the set as it is.

    Or no more, where the log itself tells the fault: what the model lacks may hide what putting it right does.
    """
    gains = _gains(fault, right, said)
    if fault.of_log:
        return not is_beyond_chance(-gains, LEAST_LEAD)
    before, after = rms(_held(*said), said[0]), rms(_held(*right), right[0])
    return is_beyond_chance(gains, LEAST_LEAD) and explained_share(before, after) > fault.worth


def with_fault(found: Diagnosis, fault: Fault, said: _Fitted) -> Diagnosis:
    """The diagnosis of a set put right: its fault comes first among what was found, the error before is the set's."""
    before, right = rms(_held(*said), said[0]), found.error_of_base
    found = dataclasses.replace(found, fault=fault, error_before=before, error_moved=right)
    if fault.moved is not None:
        return found
    nearly_all = not kept_steps(found.steps) and explained_share(before, found.error_after) >= EXPLAINED_FAR
    if found.verdict is Verdict.EXPLAINED or (found.verdict is Verdict.UNKNOWN and nearly_all):
        return dataclasses.replace(found, verdict=Verdict.DATA, effects=fault.names)
    effects = tuple(dict.fromkeys((fault.name, *found.effects))) if found.verdict.names_effects else ()
    return dataclasses.replace(found, effects=effects)


def with_fault_beside(found: Diagnosis, first: Fault, said: _Fitted) -> Diagnosis:
    """The diagnosis of a set that had a fault put right before anything else, told with what was found since."""
    if found.fault is None or not found.fault_is_rival:
        return with_fault(found, besides(first, found.fault), said)
    told, rival = with_fault(found, first, said), told_with(found.fault, first)
    return dataclasses.replace(told, verdict=found.verdict, effects=found.effects, fault=rival)


def more_likely(right: Diagnosis, said: Diagnosis) -> Diagnosis:
    """The diagnosis that held-out grasps speak for: of the set put right, or as it is; of neither, both are named."""
    if right.fault is None:
        return right
    moved, named = right.fault.moved, said.verdict.names_effects
    if moved is None and named and not said.left and len(said.fit.problem.effects) <= len(right.fit.problem.effects):
        return said  # which has no fault, needs no more effects, and leaves nothing
    gains = _gains(right.fault, (right.target, right.fit), (said.target, said.fit))
    if is_beyond_chance(gains, LEAST_LEAD) or not named:
        return right
    explained = right.verdict is Verdict.EXPLAINED
    # a time of reading is a delay by another name: below the simulation's own error no lead tells them apart
    same = moved is not None and explained and moved.groups == ("timing",)
    if is_beyond_chance(-gains, LEAST_LEAD) and not same:
        return said
    if moved is not None and explained and moved.is_no_surprise:
        return right  # what is as exact as was said leaves nothing for an effect to explain
    return dataclasses.replace(
        said, verdict=Verdict.ONE_OF, effects=(*said.effects, right.fault.name), fault=right.fault
    )


def _held(target: Target, fit: Fit) -> np.ndarray:
    return heldout_residual(fit, target, make_folds(target.grasps))


def _gains(fault: Fault, right: _Fitted, said: _Fitted) -> np.ndarray:
    """Change of the log-likelihood of each held-out grasp, or window, over what both sets have: the last rows.

    Of recordings that are cut into other windows now it is that of each recording.
    """
    better, worse = _held(*right), _held(*said)
    better = better * (right[0].sigma / said[0].sigma)
    both = (better, right[0]), (worse, said[0])
    if right[0].recordings:
        after, before = (log_likelihood_of_sizes(*one) for one in both)
        return after - before if len(after) == len(before) else _of_each(after, right[0]) - _of_each(before, said[0])
    after, before = (_by_name(log_likelihood(held[:, -better.shape[1] :]), target) for held, target in both)
    gains = np.array([after[name] - before[name] for name in after if name in before])
    return gains - (fault.moved.price / len(gains) if fault.moved else 0.0)


def _by_name(log_likelihoods: np.ndarray, target: Target) -> dict[str, float]:
    """Of each grasp, by its name: grasps may have been left out of one set and not of another."""
    return dict(zip((grasp.name for grasp in target.grasps), log_likelihoods.tolist(), strict=True))


def _of_each(log_likelihoods: np.ndarray, target: Target) -> np.ndarray:
    """Log-likelihood of each recording, ``(recordings,)``, as if all had as many readings."""
    readings = target.mask.sum(axis=1) * target.signals.shape[-1]
    recordings = target.recordings.values()
    each = [log_likelihoods[members].sum() / readings[members].sum() for members in recordings]
    return np.array(each) * readings.sum() / len(each)
