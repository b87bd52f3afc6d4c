"""The faults that a set gives reason to look for, in the order in which they are put right."""

from __future__ import annotations

import dataclasses

from forcegrasp.diagnosis.faults.even_stamps import are_even_in_truth, evenly, scatter_s
from forcegrasp.diagnosis.faults.fault import ANY, Fault, with_each
from forcegrasp.diagnosis.faults.felt_sizes import doubtful_radii
from forcegrasp.diagnosis.faults.odd_grasps import odd_grasps
from forcegrasp.diagnosis.faults.recording_faults import RecordingFault, recording_faults
from forcegrasp.diagnosis.faults.swapped_forces import grasps_with_swapped_forces, with_forces_swapped
from forcegrasp.diagnosis.faults.swapped_positions import positions_are_swapped, with_positions_swapped
from forcegrasp.diagnosis.faults.tolerance import MOST, wanted_moves
from forcegrasp.diagnosis.faults.wrong_radii import most_radii, moved_as_fault, wrong_radii
from forcegrasp.diagnosis.faults.wrong_rows import wrong_rows
from forcegrasp.diagnosis.faults.wrong_zeros import wrong_zeros
from forcegrasp.identify.base_fit import rms_error
from forcegrasp.identify.fit import Fit
from forcegrasp.identify.intervals import listed
from forcegrasp.identify.loading import Loaded
from forcegrasp.identify.target import Target
from forcegrasp.measure.check_givens import clock_factor, times
from forcegrasp.measure.force_units import find_odd_unit
from forcegrasp.measure.schema import MeasuredGrasp, MeasurementSet
from forcegrasp.short_repr import some

# What a scale or a ruler says of a recording's setting is right if it differs by no more than this share.
_SAME_SETTING = 0.02
# So many grasps are named.
_TOLD = 8
# A set of which a fit leaves less than so many times the noise is not doubted.
_NOTHING = 1.03


def leaves_nothing(fit: Fit, target: Target) -> bool:
    """Whether a fit leaves too little for the set to be doubted."""
    return rms_error(fit, target) < _NOTHING


def suspects(loaded: Loaded[MeasurementSet], target: Target, fit: Fit) -> list[Fault]:
    """The faults that a set gives reason to look for.

    Args:
      loaded: grasps of a gripper, or recordings of a servo, as the set has them.
      target: the same, lined up.
      fit: of the base model.
    """
    if leaves_nothing(fit, target):
        return []
    if loaded.gripper.is_servo:
        return _of_recordings(loaded, target, fit)
    if any(grasp.like for grasp in odd_grasps(target, fit)):  # wrong labels may look like any other fault
        return []
    measured, first = loaded.measured, [*_of_clock(loaded), *_of_swapped(loaded, target, fit)]
    others = [*wrong_zeros(loaded, target, fit), *_of_units(loaded), *wrong_rows(loaded, target, fit)]
    # rows that do not keep step with commands make a clock seem off: that must not hide the rest
    all_of_clock = all(fault.name == "time_scale" for fault in (*first, *others))
    moved = wanted_moves(measured, target, fit) if all_of_clock else None
    most = None if moved is None or moved.is_within else most_radii(loaded, moved)
    if wrong := doubtful_radii(target, fit, measured.radius_std_m):
        wider = most if most is not None and set(most.fitted) > {f"radius_m of {name}" for name in wrong} else None
        # they are fitted beside all else; what is estimated once, as a change of zero, is right only after them
        return [*first, dataclasses.replace(wrong_radii(loaded, wrong, moved), wider=wider), *others]
    if most is not None:
        return [*first, most]
    return [*first, moved_as_fault(loaded, moved)] if moved is not None and moved.is_within else [*first, *others]


def _of_clock(loaded: Loaded[MeasurementSet]) -> list[Fault]:
    """Time stamps in another unit."""
    measured = loaded.measured
    factor = clock_factor(measured, loaded.gripper.period_s, 1 + MOST * measured.period_std_share)
    if factor is None:
        return []
    words = f"time stamps are {times(factor)} for commands {loaded.gripper.period_s:g} s apart"
    right = with_each(loaded, lambda _, g: _slower(g, 1 / factor))
    return [Fault("time_scale", words, "the clock and unit of t_s", right, of_log=True)]


def _slower(grasp: MeasuredGrasp, factor: float) -> MeasuredGrasp:
    start = grasp.time_s[0]
    return dataclasses.replace(grasp, time_s=start + factor * (grasp.time_s - start))


def _of_swapped(loaded: Loaded[MeasurementSet], target: Target, fit: Fit) -> list[Fault]:
    """Columns that stand for one another, of positions, or of forces in some of the grasps.

    Whatever is estimated beside them would come out wrong.
    """
    measured = loaded.measured
    if positions_are_swapped(target, fit):
        words = f"columns {listed(measured.columns.position)} stand for one another"
        check = "which encoder each column is written from: move one finger by hand"
        return [Fault("swapped_positions", words, check, with_each(loaded, lambda _, g: with_positions_swapped(g)))]
    if swapped := grasps_with_swapped_forces(target, fit):
        names = some([measured.grasps[index].name for index in swapped], _TOLD)
        words = f"columns {listed(measured.columns.force)} stand for one another in {names}, and not in all others"
        check = "which sensor each column was written from, in grasps of centred objects too, which do not tell"
        right = with_each(loaded, lambda index, g: with_forces_swapped(g) if index in swapped else g)
        return [Fault("some_forces_swapped", words, check, right)]
    return []


def _of_units(loaded: Loaded[MeasurementSet]) -> list[Fault]:
    """A column of forces in another unit, or with another sign."""
    measured = loaded.measured
    if (unit := find_odd_unit(measured)) is None:
        return []
    words = f"column {measured.columns.force[unit.channel]} {unit.words(measured.grasps)}"
    right = with_each(loaded, lambda index, g: unit.put_right(g) if index in unit.grasps else g)
    check = "unit and sign of that column in the logs of these grasps"
    return [Fault("force_unit", words, check, right, worth=ANY)]


def uneven_stamps(loaded: Loaded[MeasurementSet], target: Target, fit: Fit) -> Fault | None:
    """Time stamps that scatter though rows were read evenly; None if they don't, or stamps are right.

    Readings say so whatever the model lacks, and no effect does the like: it is put right before all else.

    Args:
      loaded, target, fit: as for :func:`suspects`.
    """
    if loaded.gripper.is_servo or leaves_nothing(fit, target) or not are_even_in_truth(target, fit):
        return None
    words = f"time stamps scatter by {1e3 * scatter_s(target):.2g} ms, and what was read is even in time"
    check = "whether rows are stamped when they are read, and not when they are written"
    return Fault("uneven_stamps", words, check, with_each(loaded, lambda _, g: evenly(g)))


def _of_recordings(loaded: Loaded[MeasurementSet], target: Target, fit: Fit) -> list[Fault]:
    """What one recording of a servo, or the clock of all, is seen to have otherwise than the set says."""
    return [_of_recording(loaded, one) for one in recording_faults(target, fit)]


def _of_recording(loaded: Loaded[MeasurementSet], wrong: RecordingFault) -> Fault:
    right = with_each(loaded, lambda _, g: wrong.put_right(g))
    fitted = wrong.fitted(loaded.measured.grasps)
    least = _SAME_SETTING * max(map(abs, fitted.values()), default=0.0)
    words, part = wrong.words(loaded.measured.columns.unit), f"{wrong.what} of {wrong.recording}"
    return Fault(wrong.name, words, wrong.check, right, fitted=fitted, least=least, part=part)
