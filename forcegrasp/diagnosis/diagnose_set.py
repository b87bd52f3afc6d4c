"""Diagnoses a measurement set."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from forcegrasp.diagnosis.cut_short import REASONS, cut_short
from forcegrasp.diagnosis.doubt import leaves_less, more_likely, with_fault
from forcegrasp.diagnosis.faults import Fault, besides, leaves_nothing, suspects
from forcegrasp.diagnosis.late_rows import may_be_late_rows
from forcegrasp.diagnosis.law import find_law
from forcegrasp.diagnosis.left_out import LeaveOutFirst, is_answer, told_of, without
from forcegrasp.diagnosis.moved_set import MovesFirst, go_on_with_moved, within_tolerance_after_all
from forcegrasp.diagnosis.result import Diagnosis, Step
from forcegrasp.diagnosis.search import MayBeGiven, diagnose
from forcegrasp.effects import Effect
from forcegrasp.effects.for_gripper import effect_of, effects_of
from forcegrasp.errors import MeasurementError
from forcegrasp.identify import fit_set
from forcegrasp.identify.base_fit import BaseFit
from forcegrasp.identify.fit import Fit, Simulators
from forcegrasp.identify.intervals import listed
from forcegrasp.identify.loading import Loaded
from forcegrasp.identify.progress import Progress
from forcegrasp.identify.target import Target
from forcegrasp.identify.verdict import Verdict
from forcegrasp.measure import MeasurementSet
from forcegrasp.models.model_file import Model
from forcegrasp.physics.gripper import Gripper

#: A diagnosis needs so many grasps: with fewer, nothing can be held out.
LEAST_GRASPS = 6
#: A set lined up, what simulates its grasps, and the base model that was fitted to it.
Fitted = tuple[Target, Simulators, BaseFit]


def diagnose_set(
    loaded: Loaded[MeasurementSet],
    model: Model | None,
    names: list[str],
    seed: int,
    progress: Progress,
    law: bool = False,
) -> tuple[Diagnosis, Simulators]:
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
    chosen = chosen_effects(loaded.gripper, names)

    def fitted(one: Loaded[MeasurementSet]) -> Fitted:
        if model is None:
            return fit_set.fit_model(one, seed, progress)
        return fit_set.apply_model(one, model, progress, refit=True)

    def search(
        target: Target,
        simulators: Simulators,
        base: BaseFit,
        start: tuple[Fit, Sequence[Step]] | None = None,
        may_be_given: MayBeGiven | None = None,
    ) -> Diagnosis:
        rng = np.random.default_rng(seed + 1)
        return diagnose(target, base, simulators, chosen, rng, progress, start, may_be_given)

    def search_on(target: Target, simulators: Simulators, base: BaseFit, fit: Fit, steps: Sequence[Step]) -> Diagnosis:
        return search(target, simulators, base, (fit, steps))

    def moved(found: Diagnosis, of_set: Loaded[MeasurementSet]) -> tuple[Diagnosis, Simulators] | None:
        further = go_on_with_moved(found, of_set, search_on, progress)
        if further is None and found.bolder is not None:
            further = go_on_with_moved(found.bolder, of_set, search_on, progress)
            return further if further is not None and not further[0].left else None
        return further

    def search_and_move(
        of_set: Loaded[MeasurementSet], target: Target, simulators: Simulators, base: BaseFit
    ) -> tuple[Diagnosis, tuple[Diagnosis, Simulators] | None]:
        """The diagnosis of a set, and that of the set with moves within its tolerance if it wants any."""
        moves, leave_out = None if of_set.gripper.is_servo else MovesFirst(of_set), LeaveOutFirst()

        def something_else_first(target: Target, fit: Fit) -> bool:
            move = moves is not None and moves(target, fit)
            return leave_out(target, fit) or move

        found = search(target, simulators, base, may_be_given=something_else_first)
        if found.stopped:
            return found, None
        try:
            further = moved(found, of_set)
            if further is None and leave_out.names:
                rest = without_missed(of_set, target, leave_out.names)
                if rest[0].stopped and not is_answer(rest[0]):
                    return dataclasses.replace(found, stopped=rest[0].stopped), None
                further = rest if is_answer(rest[0]) else None
            if further is None and (leave_out.names or (moves is not None and moves.asked)):  # it was neither
                again = search(target, simulators, base)
                if again.stopped:
                    return dataclasses.replace(found, stopped=again.stopped), None
                found, further = again, moved(again, of_set)
        except REASONS as reason:
            return dataclasses.replace(found, stopped=cut_short(reason, progress)), None
        return found, further

    def without_missed(
        of_set: Loaded[MeasurementSet], target: Target, names: Sequence[str]
    ) -> tuple[Diagnosis, Simulators]:
        """The diagnosis without these grasps."""
        progress(f"fitting the set without {listed(names)}, which the model misses most")
        rest = without(of_set, names)
        of_rest, simulators, base = fitted(rest)
        found = search(of_rest, simulators, base, may_be_given=lambda *_: True)
        further = None if found.stopped else moved(found, rest)
        found, simulators = further or (found, simulators)
        return told_of(found, names, target), simulators

    def as_said() -> tuple[Diagnosis, Simulators]:
        found, further = search_and_move(loaded, *said)
        return further or (within_tolerance_after_all(found, loaded), said[1])

    said = fitted(loaded)

    def with_law(diagnosis: Diagnosis, simulators: Simulators) -> tuple[Diagnosis, Simulators]:
        rng, found, stopped = np.random.default_rng(seed + 2), None, diagnosis.stopped
        try:
            found = find_law(diagnosis, simulators, rng, progress) if law and not stopped else None
        except REASONS as reason:
            stopped = cut_short(reason, progress)
        told, sought = may_be_late_rows(diagnosis, loaded), law and not stopped
        return dataclasses.replace(told, law=found, law_sought=sought, stopped=stopped), simulators

    def put_right(fault: Fault) -> tuple[Fault, Fitted] | None:
        progress(f"fitting the set with {fault.name} put right")
        right, wider = fitted(fault.put_right), fault.wider
        if not leaves_less(fault, (right[0], right[2].fit), (said[0], said[2].fit)):
            return None
        if wider is not None and not leaves_nothing(right[2].fit, right[0]):
            progress("fitting it with the radii of more objects put right")
            more = fitted(wider.put_right)
            if leaves_less(wider, (more[0], more[2].fit), (right[0], right[2].fit)):
                return wider, more
        return fault, right

    def put_right_or_as_said() -> tuple[Diagnosis, Simulators]:
        for suspect in suspects(loaded, said[0], said[2].fit):
            if (better := put_right(suspect)) is not None:
                fault, right = better
                # what is a little off besides shows once the fault does not hide it
                further, on_moved = (search(*right), None) if fault.moved else search_and_move(fault.put_right, *right)
                if on_moved is not None:
                    further, simulators = on_moved
                    right, fault = (further.target, simulators, further.base), besides(fault, further.fault)
                if not further.stopped and not fault.is_borne_out(further.fit):  # an effect had made it seem so
                    continue
                found = with_fault(further, fault.told_by(further.fit), (said[0], said[2].fit))
                # else effects may do as well without it
                certain = found.verdict is Verdict.DATA and not (found.left or fault.moved or fault.of_most)
                likely = found
                if not (certain or found.stopped):
                    as_it_is = search(*said)
                    likely = dataclasses.replace(more_likely(found, as_it_is), stopped=as_it_is.stopped)
                return likely, right[1] if likely.target.grasps is right[0].grasps else said[1]
        return as_said()

    try:
        diagnosis, simulators = put_right_or_as_said()
    except REASONS as reason:  # before any search had begun
        stopped = cut_short(reason, progress)
        target, simulators, base = said
        nothing = diagnose(target, base, simulators, [], np.random.default_rng(seed + 1), progress)
        diagnosis = dataclasses.replace(nothing, stopped=stopped)
    return with_law(diagnosis, simulators)


def chosen_effects(gripper: Gripper, names: Sequence[str]) -> list[type[Effect]]:
    """The effects of these names as a gripper has them, in the order in which they act; without names all.

    Raises:
      ConfigError: if one is unknown, or can't show on this gripper.
    """
    wanted = {effect_of(name, gripper).name for name in names}
    return [effect for name, effect in effects_of(gripper).items() if not names or name in wanted]
