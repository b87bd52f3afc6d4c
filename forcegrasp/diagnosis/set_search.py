"""How a measurement set is fitted and searched: as it is, with what it gives moved, or without some grasps."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from forcegrasp.diagnosis.cut_short import REASONS, cut_short
from forcegrasp.diagnosis.evidence import LEAST_SHARE_TOGETHER
from forcegrasp.diagnosis.faults.fault import Fault
from forcegrasp.diagnosis.faults.suspects import leaves_nothing, uneven_stamps
from forcegrasp.diagnosis.givens.doubt import is_worth_a_search
from forcegrasp.diagnosis.givens.fitted_givens import told_as_moved, with_fitted_givens
from forcegrasp.diagnosis.givens.give_back import without_move
from forcegrasp.diagnosis.givens.givens_besides import Fitted, with_givens_put_right
from forcegrasp.diagnosis.givens.left_out import LeaveOutFirst, is_answer, told_of, without
from forcegrasp.diagnosis.givens.moved_set import MovesFirst, go_on_with_moved
from forcegrasp.diagnosis.result import Diagnosis, Step, kept_steps
from forcegrasp.diagnosis.search.search import diagnose
from forcegrasp.diagnosis.search.stop_when import AT_ITS_END, StopWhen, always, never
from forcegrasp.diagnosis.verdict import EXPLAINED_FAR, MUCH, explained_share
from forcegrasp.effects import Effect
from forcegrasp.identify import fit_set
from forcegrasp.identify.base_fit import BaseFit, rms_error
from forcegrasp.identify.fit import Fit
from forcegrasp.identify.fitted_model import model_of
from forcegrasp.identify.intervals import listed
from forcegrasp.identify.loading import Loaded
from forcegrasp.identify.progress import Progress
from forcegrasp.identify.simulators import Simulators
from forcegrasp.identify.target import Target
from forcegrasp.measure import MeasurementSet
from forcegrasp.models.model_file import Model

# Effects whose signatures promise too little are not fitted.
_BRIEFLY = StopWhen(may_be_given=always)
#: A diagnosis, and what simulates its grasps.
Found = tuple[Diagnosis, Simulators]


class ZerosFirst(Exception):  # noqa: N818  (nothing is wrong with the search)
    """Zeros of sessions are to be put right before more effects are looked for than were found."""

    def __init__(self, found: Diagnosis) -> None:
        super().__init__()
        self.found = found


@dataclass(frozen=True)
class SetSearch:
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
        """The diagnosis of a set; and that with moves within its tolerance, or without some grasps, if it wants any.

        Raises:
          ZerosFirst: if zeros differ from session to session, which effects that were found had hidden.
        """
        as_given, is_whole = self.search_as_given(loaded, fitted)
        if as_given is not None and is_whole:
            return as_given, None
        return self.search_with_givens(loaded, fitted) or self.search_as_it_is(loaded, fitted, as_given)

    def search_as_given(self, loaded: Loaded[MeasurementSet], fitted: Fitted) -> tuple[Diagnosis | None, bool]:
        """The diagnosis with radii and places as given, and whether it is the answer; None if moves might be it.

        It is if effects leave only noise: to fit what is given beside them takes as long as all else, and changes
        nothing then.
        """
        target, _, base = fitted
        if loaded.gripper.is_servo or rms_error(base.fit, target) < MUCH:
            return None, False
        moves, sessions = MovesFirst(loaded, ask_sessions=False), MovesFirst(loaded, self.ask_sessions)
        if moves.before_more(target, base.fit):
            return None, False
        found = self.search(*fitted, stop_when=StopWhen(always, sessions.before_more, goes_on=True))
        nearly_all = explained_share(found.error_before, found.error_after, noise=found.floor) >= EXPLAINED_FAR
        if found.stopped:
            return found, True
        if sessions.zeros:
            raise ZerosFirst(found)
        return found, found.verdict.names_effects and nearly_all and not (found.left or sessions.asked)

    def search_with_givens(self, loaded: Loaded[MeasurementSet], fitted: Fitted) -> tuple[Diagnosis, Found] | None:
        """The same with radii and places fitted beside all effects; None if they explain little, or are wrong."""
        if (with_givens := with_fitted_givens(loaded, fitted, self.progress)) is None:
            return None
        found, further = self.search_as_it_is(*with_givens)
        told = told_as_moved(found if further is None else further[0], loaded, fitted)
        return None if told is None else (found, (told, Simulators(told.fit.problem)))

    def search_as_it_is(
        self, loaded: Loaded[MeasurementSet], fitted: Fitted, begun: Diagnosis | None = None
    ) -> tuple[Diagnosis, Found | None]:
        """The same with radii and places where they are; they are moved where that explains what effects leave.

        Args:
          loaded: the set.
          fitted: the same, fitted.
          begun: effects that a search found before: it goes on from there.
        """
        moves = None if loaded.gripper.is_servo else MovesFirst(loaded, self.ask_sessions)
        leave_out = LeaveOutFirst()

        def something_else_first(target: Target, fit: Fit) -> bool:
            move = moves is not None and moves(target, fit)
            return leave_out(target, fit) or move

        first, explains = (never, never) if moves is None else (moves.before_more, moves.explain)
        (target, simulators, base), start = fitted, None
        if begun is not None and begun.verdict.names_effects:
            base = begun.base  # which may be better
            start = begun.fit, kept_steps(begun.steps)
        stop_when = StopWhen(something_else_first, first, explains)
        found = self.search(target, simulators, base, start=start, stop_when=stop_when)
        if found.stopped:
            return found, None
        if moves is not None and moves.zeros:
            raise ZerosFirst(found)
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
                again = self.search(target, simulators, base, start=(trial.fit, kept_steps(trial.steps)))
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
        less = is_worth_a_search(fault, model_on(right), model_on(said))
        if wider is not None and (less or widely) and not leaves_nothing(right[2].fit, right[0]):
            self.progress("fitting it with the radii of more objects put right")
            more = self.fitted(wider.put_right)
            if is_worth_a_search(wider, model_on(more), model_on(right if less else said)):
                return wider, more
        return (fault, right) if less else None


def _is_convincing(moved: Diagnosis) -> bool:
    """Whether effects that were too little before the set was moved leave nothing with it, or explain most."""
    explained = explained_share(moved.error_before, moved.error_after, noise=moved.floor)
    return not moved.left or explained >= LEAST_SHARE_TOGETHER


def model_on(fitted: Fitted) -> tuple[Target, Fit]:
    """A set lined up, and the model that was fitted to it."""
    return fitted[0], fitted[2].fit
