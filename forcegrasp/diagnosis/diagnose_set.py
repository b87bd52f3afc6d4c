"""Diagnoses a measurement set."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from forcegrasp.diagnosis.cut_short import REASONS, cut_short
from forcegrasp.diagnosis.faults.fault import Fault
from forcegrasp.diagnosis.faults.session_zeros import session_zeros
from forcegrasp.diagnosis.faults.suspects import suspects
from forcegrasp.diagnosis.faults.wrong_zeros import differing
from forcegrasp.diagnosis.givens.doubt import more_likely, with_fault_beside
from forcegrasp.diagnosis.givens.givens_besides import Fitted
from forcegrasp.diagnosis.givens.late_rows import may_be_late_rows
from forcegrasp.diagnosis.givens.moved_set import timing_within_tolerance_after_all, within_tolerance_after_all
from forcegrasp.diagnosis.law.law import find_law
from forcegrasp.diagnosis.result import Diagnosis
from forcegrasp.diagnosis.search.stop_when import StopWhen, always, never
from forcegrasp.diagnosis.set_search import Found, SetSearch, ZerosFirst, model_on
from forcegrasp.diagnosis.verdict import EXPLAINED_FAR, explained_share
from forcegrasp.effects import Effect
from forcegrasp.effects.for_gripper import effect_of, effects_of
from forcegrasp.errors import MeasurementError
from forcegrasp.identify.fit import with_own_slopes
from forcegrasp.identify.fitted_model import model_of
from forcegrasp.identify.givens import errors_by_givens
from forcegrasp.identify.loading import Loaded
from forcegrasp.identify.progress import Progress
from forcegrasp.identify.simulators import Simulators
from forcegrasp.identify.verdict import Verdict
from forcegrasp.measure import MeasurementSet
from forcegrasp.models.model_file import Model
from forcegrasp.physics.gripper import Gripper

#: A diagnosis needs so many grasps: with fewer, nothing can be held out.
LEAST_GRASPS = 6
# An effect does not do as well as a set put right if it leaves more than so many times the squares.
_AS_WELL = 2.0


def diagnose_set(
    loaded: Loaded[MeasurementSet],
    model: Model | None,
    names: list[str],
    seed: int,
    progress: Progress,
    law: bool = False,
) -> Found:
    """Which effects are missing, or what is wrong with the set; with ``law`` also a formula for what no effect tells.

    Ctrl-C, or the end of a time limit, ends it with what was found by then, once the base model is fitted.

    Raises:
      MeasurementError: if there are too few grasps to hold any out.
      OutOfTimeError: if the time was over before the base model was fitted.
      ConfigError: if an effect is unknown, or can't show on this gripper.
    """
    if loaded.held_out < LEAST_GRASPS:
        raise MeasurementError(
            f"{loaded.measured.path}: {loaded.held_out} grasps are too few for a diagnosis,"
            f" {LEAST_GRASPS} are needed; record more (forcegrasp record shows a plan)"
        )
    ways = SetSearch(model, chosen_effects(loaded.gripper, names), seed, progress)
    given = said = ways.fitted(loaded)
    stamps = None
    try:
        stamps = ways.put_stamps_right(loaded, said)
        if stamps is not None:
            loaded, said = stamps[0].put_right, stamps[1]
        diagnosis, simulators = _put_right_or_as_said(ways, loaded, said)
    except REASONS as reason:
        diagnosis, simulators = ways.found_nothing(said, reason)
    diagnosis = timing_within_tolerance_after_all(diagnosis, loaded)
    if stamps is not None:
        diagnosis = with_fault_beside(diagnosis, stamps[0], (given[0], given[2].fit))
    diagnosis = _with_intervals(diagnosis, loaded, progress)
    sought, found = law and not diagnosis.stopped, None
    if sought:
        try:
            found = find_law(diagnosis, simulators, np.random.default_rng(seed + 2), progress)
        except REASONS as reason:
            diagnosis, sought = dataclasses.replace(diagnosis, stopped=cut_short(reason, progress)), False
    return dataclasses.replace(may_be_late_rows(diagnosis, loaded), law=found, law_sought=sought), simulators


def _is_no_surprise(found: Diagnosis) -> bool:
    """Whether no effect need be held against moves of radii and places that alone explain a set."""
    moved = None if found.fault is None else found.fault.moved
    return found.verdict is not Verdict.EXPLAINED or moved is None or moved.is_no_surprise


def _put_right_or_as_said(
    ways: SetSearch, loaded: Loaded[MeasurementSet], said: Fitted, known: Sequence[Fault] = ()
) -> Found:
    """The diagnosis with the first fault put right that makes the set likelier; of the set as it is if none does.

    A set may have several: once one is put right, the others are looked for in what is left. Where that is cut short
    what was put right by then is told.

    Args:
      ways: how it is fitted and searched.
      loaded: the set.
      said: the same, fitted.
      known: faults that were put right already, or are not to be.
    """
    try:
        return _likeliest(ways, loaded, said, known)
    except ZerosFirst as first:
        return _with_zeros_put_right(ways, loaded, said, known, first.found)
    except REASONS as reason:
        return ways.found_nothing(said, reason)


def _with_zeros_put_right(
    ways: SetSearch, loaded: Loaded[MeasurementSet], said: Fitted, known: Sequence[Fault], found: Diagnosis
) -> Found:
    """The diagnosis, begun anew with zeros of sessions put right that effects had hidden; as it is if none is better.

    Args:
      ways, loaded, said, known: as for :func:`_put_right_or_as_said`.
      found: with the effects that had hidden them.
    """
    once, simulators = dataclasses.replace(ways, ask_sessions=False), Simulators(found.fit.problem)
    with_effects = dataclasses.replace(ways, model=model_of(found.fit, found.target, loaded, ()))
    as_fitted = dataclasses.replace(loaded, measured=dataclasses.replace(loaded.measured, grasps=found.target.grasps))
    base = dataclasses.replace(found.base, fit=found.fit)
    try:
        zeros = session_zeros(found.target, found.fit)  # none, if another fit than this had them
        fitted = found.target, simulators, base
        if zeros is None or with_effects.put_right(differing(as_fitted, zeros), fitted) is None:
            return _put_right_or_as_said(once, loaded, said, known)
        fault = differing(loaded, zeros)
        right = ways.fitted(fault.put_right)
    except REASONS as reason:
        return dataclasses.replace(found, stopped=cut_short(reason, ways.progress)), simulators
    further, simulators = _put_right_or_as_said(once, fault.put_right, right, (*known, fault))
    return with_fault_beside(further, fault, model_on(said)), simulators


def _likeliest(ways: SetSearch, loaded: Loaded[MeasurementSet], said: Fitted, known: Sequence[Fault]) -> Found:
    """See :func:`_put_right_or_as_said`, whose arguments these are."""
    search = ways.search_and_move
    for suspect in suspects(loaded, said[0], said[2].fit):
        if suspect.of in [fault.of for fault in known]:
            continue
        if suspect.moved is not None and suspect.moved.groups == ("object",):
            # beside effects they go where these leave them; put where the base model wants them they are in their way
            both, search = ways.search_with_givens(loaded, said), ways.search_as_it_is
            if both is not None and _is_no_surprise(both[1][0]):
                return both[1]
        if (better := ways.put_right(suspect, said)) is None:
            continue
        (fault, right), of_said = better, said[1]
        if fault.moved:
            further = ways.search(*right)
        else:  # what else is wrong, or a little off, shows once the fault does not hide it
            further, simulators = _put_right_or_as_said(ways, fault.put_right, right, (*known, fault))
            right = further.target, simulators, further.base
        if not further.stopped and not fault.is_borne_out(further.fit):  # an effect had made it seem so
            continue
        likely = with_fault_beside(further, fault.told_by(further.fit), model_on(said))
        of_most = fault.of_most and not fault.is_of_few(further.fit)
        certain = likely.verdict is Verdict.DATA and not (likely.left or fault.moved or of_most)
        # what is as exact as was said, and leaves nothing, leaves no effect anything to explain
        certain |= likely.verdict is Verdict.EXPLAINED and fault.moved is not None and fault.moved.is_no_surprise
        if not (certain or likely.stopped):  # effects may do as well without it
            # where next to nothing is left what does as well would show at once
            left = explained_share(likely.error_before, likely.error_after, noise=likely.floor) < EXPLAINED_FAR
            most = np.inf if left else _AS_WELL * further.fit.cost
            given = never if left and likely.left else always
            if fault.of_log:  # in the set as it is, too, something else may be wrong, or a little off
                as_it_is, of_said = _put_right_or_as_said(ways, loaded, said, (*known, fault))
            else:
                as_it_is = ways.search(*said, stop_when=StopWhen(given, most=most))
            likely = dataclasses.replace(more_likely(likely, as_it_is), stopped=as_it_is.stopped)
        return likely, right[1] if likely.target.grasps is right[0].grasps else of_said
    found, further = search(loaded, said)
    if further is None and (further := ways.put_right_besides(found, loaded)) is None:
        return within_tolerance_after_all(found, loaded), said[1]
    return further


def _with_intervals(found: Diagnosis, loaded: Loaded[MeasurementSet], progress: Progress) -> Diagnosis:
    """The diagnosis with what its intervals need; as it is if that is cut short, for the search is over."""
    try:
        if found.fit is found.base.fit and not found.stopped:  # effects were fitted to their end
            fit = with_own_slopes(found.fit, found.target, Simulators(found.fit.problem), progress)
            found = dataclasses.replace(found, fit=fit, base=dataclasses.replace(found.base, fit=fit))
        by_givens = tuple(errors_by_givens(found.fit, found.target, loaded.measured))
        return dataclasses.replace(found, by_givens=by_givens)
    except REASONS as reason:
        cut_short(reason, progress)
        return found


def chosen_effects(gripper: Gripper, names: Sequence[str]) -> list[type[Effect]]:
    """The effects of these names as a gripper has them, in the order in which they act; without names all.

    Raises:
      ConfigError: if one is unknown, or can't show on this gripper.
    """
    wanted = {effect_of(name, gripper).name for name in names}
    return [effect for name, effect in effects_of(gripper).items() if not names or name in wanted]
