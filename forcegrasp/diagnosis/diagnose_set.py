"""Diagnoses a measurement set."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from forcegrasp.diagnosis.cut_short import REASONS, cut_short
from forcegrasp.diagnosis.evidence import LEAST_SHARE_TOGETHER
from forcegrasp.diagnosis.faults.fault import Fault
from forcegrasp.diagnosis.faults.session_zeros import session_zeros
from forcegrasp.diagnosis.faults.suspects import leaves_nothing, suspects, uneven_stamps
from forcegrasp.diagnosis.faults.wrong_zeros import differing
from forcegrasp.diagnosis.givens.doubt import is_worth_a_search, more_likely, with_fault_beside
from forcegrasp.diagnosis.givens.fitted_givens import told_as_moved, with_fitted_givens
from forcegrasp.diagnosis.givens.give_back import without_move
from forcegrasp.diagnosis.givens.givens_besides import Fitted, with_givens_put_right
from forcegrasp.diagnosis.givens.late_rows import may_be_late_rows
from forcegrasp.diagnosis.givens.left_out import LeaveOutFirst, is_answer, told_of, without
from forcegrasp.diagnosis.givens.moved_set import (
    MovesFirst,
    go_on_with_moved,
    timing_within_tolerance_after_all,
    within_tolerance_after_all,
)
from forcegrasp.diagnosis.law.law import find_law
from forcegrasp.diagnosis.result import Diagnosis, Step, kept_steps
from forcegrasp.diagnosis.search.search import diagnose
from forcegrasp.diagnosis.search.stop_when import AT_ITS_END, StopWhen, always, never
from forcegrasp.diagnosis.verdict import EXPLAINED_FAR, MUCH, explained_share
from forcegrasp.effects import Effect
from forcegrasp.effects.for_gripper import effect_of, effects_of
from forcegrasp.errors import MeasurementError
from forcegrasp.identify import fit_set
from forcegrasp.identify.base_fit import BaseFit, rms_error
from forcegrasp.identify.fit import Fit, with_own_slopes
from forcegrasp.identify.fitted_model import model_of
from forcegrasp.identify.givens import errors_by_givens
from forcegrasp.identify.intervals import listed
from forcegrasp.identify.loading import Loaded
from forcegrasp.identify.progress import Progress
from forcegrasp.identify.simulators import Simulators
from forcegrasp.identify.target import Target
from forcegrasp.identify.verdict import Verdict
from forcegrasp.measure import MeasurementSet
from forcegrasp.models.model_file import Model
from forcegrasp.physics.gripper import Gripper

#: A diagnosis needs so many grasps: with fewer, nothing can be held out.
LEAST_GRASPS = 6
# An effect does not do as well as a set put right if it leaves more than so many times the squares.
_AS_WELL = 2.0
# Effects whose signatures promise too little are not fitted.
_BRIEFLY = StopWhen(may_be_given=always)
#: A diagnosis, and what simulates its grasps.
Found = tuple[Diagnosis, Simulators]


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
    ways = _Ways(model, chosen_effects(loaded.gripper, names), seed, progress)
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


class _ZerosFirst(Exception):  # noqa: N818  (nothing is wrong with the search)
    """Zeros of sessions are to be put right before more effects are looked for than were found."""

    def __init__(self, found: Diagnosis) -> None:
        super().__init__()
        self.found = found


@dataclass(frozen=True)
class _Ways:
    """How sets are fitted and searched: as they are, with givens moved, or without some grasps."""

    model: Model | None  #: what to start from; the base model by default
    effects: list[type[Effect]]
    seed: int
    progress: Progress
    ask_sessions: bool = True  #: whether zeros of sessions may be put right once effects are known

    def fitted(self, loaded: Loaded[MeasurementSet]) -> Fitted:
        """A set, fitted."""
        if self.model is None:
            return fit_set.fit_model(loaded, self.seed, self.progress, hasty=True)
        return fit_set.apply_model(loaded, self.model, self.progress, refit=True)

    def search(
        self,
        target: Target,
        simulators: Simulators,
        base: BaseFit,
        start: tuple[Fit, Sequence[Step]] | None = None,
        stop_when: StopWhen = AT_ITS_END,
    ) -> Diagnosis:
        """See :func:`.search.diagnose`."""
        rng = np.random.default_rng(self.seed + 1)
        return diagnose(target, base, simulators, self.effects, rng, self.progress, start, stop_when)

    def found_nothing(self, said: Fitted, reason: BaseException) -> Found:
        """The diagnosis of a set that was cut short before any search of it had begun."""
        stopped = cut_short(reason, self.progress)
        nothing = dataclasses.replace(self, effects=[]).search(*said)
        return dataclasses.replace(nothing, stopped=stopped), said[1]

    def moved(self, found: Diagnosis, loaded: Loaded[MeasurementSet], briefly: bool = False) -> Found | None:
        """The diagnosis with what the set gives moved within its tolerance; None if nothing asks for that.

        Args:
          found: of the set as it is.
          loaded: the set.
          briefly: effects that promise too little are not fitted again: all were, and the move changes little.
        """
        search_on = partial(self._search_on, stop_when=_BRIEFLY if briefly else AT_ITS_END)
        further = go_on_with_moved(found, loaded, search_on, self.progress, self.effects)
        if further is None and found.bolder is not None:
            found = found.bolder
            further = go_on_with_moved(found, loaded, search_on, self.progress, self.effects)
            further = further if further is not None and _is_convincing(further[0]) else None
        if further is None or (back := without_move(further[0], found, search_on, self.progress)) is None:
            return further
        return go_on_with_moved(back[0], loaded, search_on, self.progress, self.effects) or back

    def _search_on(
        self, target: Target, simulators: Simulators, base: BaseFit, fit: Fit, steps: Sequence[Step],
        stop_when: StopWhen = AT_ITS_END,
    ) -> Diagnosis:  # fmt: skip
        return self.search(target, simulators, base, (fit, steps), stop_when)

    def search_and_move(self, loaded: Loaded[MeasurementSet], fitted: Fitted) -> tuple[Diagnosis, Found | None]:
        """The diagnosis of a set; and that with moves within its tolerance, or without some grasps, if it wants any."""
        as_given = self.search_as_given(loaded, fitted)
        if as_given is not None:
            return as_given, None
        return self.search_with_givens(loaded, fitted) or self.search_as_it_is(loaded, fitted)

    def search_as_given(self, loaded: Loaded[MeasurementSet], fitted: Fitted) -> Diagnosis | None:
        """The diagnosis with radii and places as given; None unless effects leave only noise, or if moves might do so.

        To fit them beside all effects takes as long as all else, and changes nothing then.
        """
        target, _, base = fitted
        if loaded.gripper.is_servo or rms_error(base.fit, target) < MUCH:
            return None
        moves, sessions = MovesFirst(loaded, ask_sessions=False), MovesFirst(loaded, self.ask_sessions)
        if moves.before_more(target, base.fit):
            return None
        found = self.search(*fitted, stop_when=StopWhen(always, sessions.before_more))
        nearly_all = explained_share(found.error_before, found.error_after, noise=found.floor) >= EXPLAINED_FAR
        if found.stopped:
            return found
        if sessions.zeros:
            raise _ZerosFirst(found)
        whole = found.verdict.names_effects and nearly_all and not (found.left or sessions.asked)
        return found if whole else None

    def search_with_givens(self, loaded: Loaded[MeasurementSet], fitted: Fitted) -> tuple[Diagnosis, Found] | None:
        """The same with radii and places fitted beside all effects; None if they explain little, or are wrong."""
        if (with_givens := with_fitted_givens(loaded, fitted, self.progress)) is None:
            return None
        found, further = self.search_as_it_is(*with_givens)
        told = told_as_moved(found if further is None else further[0], loaded, fitted)
        return None if told is None else (found, (told, Simulators(told.fit.problem)))

    def search_as_it_is(self, loaded: Loaded[MeasurementSet], fitted: Fitted) -> tuple[Diagnosis, Found | None]:
        moves = None if loaded.gripper.is_servo else MovesFirst(loaded, self.ask_sessions)
        leave_out = LeaveOutFirst()

        def something_else_first(target: Target, fit: Fit) -> bool:
            move = moves is not None and moves(target, fit)
            return leave_out(target, fit) or move

        first, explains = (never, never) if moves is None else (moves.before_more, moves.explain)
        found = self.search(*fitted, stop_when=StopWhen(something_else_first, first, explains))
        if found.stopped:
            return found, None
        if moves is not None and moves.zeros:
            raise _ZerosFirst(found)
        try:
            if moves is not None and moves.beyond and (further := self.put_right_besides(found, loaded, least=1.0)):
                return found, further
            further = self.moved(found, loaded, briefly=moves is not None and not (moves.asked or leave_out.names))
            if further is None and leave_out.names:
                rest = self.without_missed(loaded, fitted[0], leave_out.names)
                if rest[0].stopped and not is_answer(rest[0]):
                    return dataclasses.replace(found, stopped=rest[0].stopped), None
                further = rest if is_answer(rest[0]) else None
            something_else = leave_out.names or (moves is not None and moves.asked)
            if further is None and something_else and not found.is_of_none:  # it was neither
                trial = found.bolder or found  # what was not believed need not be looked for anew
                again = self.search(*fitted, start=(trial.fit, kept_steps(trial.steps)))
                if again.stopped:
                    return dataclasses.replace(found, stopped=again.stopped), None
                if trial is found or again.verdict.lacks_effects:
                    found, further = again, self.moved(again, loaded, briefly=True)
        except REASONS as reason:
            return dataclasses.replace(found, stopped=cut_short(reason, self.progress)), None
        return found, further

    def without_missed(self, loaded: Loaded[MeasurementSet], target: Target, names: Sequence[str]) -> Found:
        """The diagnosis without the grasps of these names."""
        self.progress(f"fitting the set without {listed(names)}, which the model misses most")
        rest = without(loaded, names)
        of_rest, simulators, base = self.fitted(rest)
        found = self.search(of_rest, simulators, base, stop_when=_BRIEFLY)
        further = None if found.stopped else self.moved(found, rest)
        found, simulators = further or (found, simulators)
        return told_of(found, names, target), simulators

    def put_right_besides(self, found: Diagnosis, loaded: Loaded[MeasurementSet], least: float = MUCH) -> Found | None:
        """See :func:`.with_givens_put_right`."""

        def put_right(fault: Fault, said: Fitted) -> tuple[Fault, Fitted] | None:
            model = fault.begun_from(model_of(said[2].fit, said[0], loaded, ()))
            return dataclasses.replace(self, model=model).put_right(fault, said, widely=True)

        try:
            return with_givens_put_right(found, loaded, put_right, self._search_on, self.progress, least)
        except REASONS as reason:
            return dataclasses.replace(found, stopped=cut_short(reason, self.progress)), Simulators(found.fit.problem)

    def put_stamps_right(self, loaded: Loaded[MeasurementSet], said: Fitted) -> tuple[Fault, Fitted] | None:
        """Time stamps that scatter though rows were read evenly, and the set without that, fitted; None if none do."""
        fault = uneven_stamps(loaded, said[0], said[2].fit)
        if fault is None:
            return None
        self.progress(f"fitting the set with {fault.name} put right")
        return fault, self.fitted(fault.put_right)

    def put_right(self, fault: Fault, said: Fitted, widely: bool = False) -> tuple[Fault, Fitted] | None:
        """The fault, or a wider one, and the set without it, fitted; None unless that leaves much less.

        Args:
          fault: what may be wrong.
          said: the set as it is, fitted.
          widely: whether the wider one is tried though the fault itself leaves as much.
        """
        self.progress(f"fitting the set with {fault.name} put right")
        right, wider = self.fitted(fault.put_right), fault.wider
        less = is_worth_a_search(fault, _model(right), _model(said))
        if wider is not None and (less or widely) and not leaves_nothing(right[2].fit, right[0]):
            self.progress("fitting it with the radii of more objects put right")
            more = self.fitted(wider.put_right)
            if is_worth_a_search(wider, _model(more), _model(right if less else said)):
                return wider, more
        return (fault, right) if less else None


def _model(fitted: Fitted) -> tuple[Target, Fit]:
    """A set lined up, and the model that was fitted to it."""
    return fitted[0], fitted[2].fit


def _is_no_surprise(found: Diagnosis) -> bool:
    """Whether no effect need be held against moves of radii and places that alone explain a set."""
    moved = None if found.fault is None else found.fault.moved
    return found.verdict is not Verdict.EXPLAINED or moved is None or moved.is_no_surprise


def _is_convincing(moved: Diagnosis) -> bool:
    """Whether effects that were too little before the set was moved leave nothing with it, or explain most."""
    explained = explained_share(moved.error_before, moved.error_after, noise=moved.floor)
    return not moved.left or explained >= LEAST_SHARE_TOGETHER


def _put_right_or_as_said(
    ways: _Ways, loaded: Loaded[MeasurementSet], said: Fitted, known: Sequence[Fault] = ()
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
    except _ZerosFirst as first:
        return _with_zeros_put_right(ways, loaded, said, known, first.found)
    except REASONS as reason:
        return ways.found_nothing(said, reason)


def _with_zeros_put_right(
    ways: _Ways, loaded: Loaded[MeasurementSet], said: Fitted, known: Sequence[Fault], found: Diagnosis
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
    return with_fault_beside(further, fault, _model(said)), simulators


def _likeliest(ways: _Ways, loaded: Loaded[MeasurementSet], said: Fitted, known: Sequence[Fault]) -> Found:
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
        likely = with_fault_beside(further, fault.told_by(further.fit), _model(said))
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
