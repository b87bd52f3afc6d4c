"""Can this set be right? Refuses what no physical effect explains, warns of what is odd, accepts the rest."""

from __future__ import annotations

import math

import numpy as np

from forcegrasp.errors import MeasurementError
from forcegrasp.measure.check_commands import refuse_copied_command
from forcegrasp.measure.check_copies import check_copies
from forcegrasp.measure.check_liveness import check_liveness
from forcegrasp.measure.check_repeats import check_repeats
from forcegrasp.measure.check_signs import PadsAt, check_signs
from forcegrasp.measure.check_starts import check_starts
from forcegrasp.measure.check_units import check_force_noise, check_forces, check_units
from forcegrasp.measure.folder import show
from forcegrasp.measure.samples import MIN_SAMPLES, check_samples, place
from forcegrasp.measure.schema import FinalForceTable, MeasurementSet

#: A pause this many times the median sample interval is worth a warning.
_GAP = 5
#: What is said of a set that has a single grasp, unless it is joined with others.
ALONE = "one grasp only; nothing can be held out to test a finding on"


def check_set(
    measured: MeasurementSet,
    open_m: float,
    closed_m: float = 0.0,
    half_opening_m: float | None = None,
    pads_at: PadsAt | None = None,
) -> list[str]:
    """Checks a set against the gripper it is said to come from.

    Bias, drift, delays, dead zones, saturation, crosstalk, adhesion and the like are legitimate: they are for the
    diagnosis to find.

    Args:
      measured: the set.
      open_m: position of a motor that is fully open, m or rad.
      closed_m: position of a motor that is fully closed.
      half_opening_m: half of what fits between the pads; left out, a sliding motor's reach; of one that turns, any.
      pads_at: from positions of the motors to where the pads stand, see
        :meth:`~forcegrasp.physics.gripper.Gripper.pads_at`; left out, positions of two sliding motors are those of the
        pads, and of others what depends on it is not checked.

    Returns:
      Warnings, one line each.

    Raises:
      MeasurementError: if the set can't be right: where, why, and what to do.
    """
    if not measured.grasps:
        raise MeasurementError(f"{show(measured.path)}: holds no grasps; record some")
    for grasp in measured.grasps:
        check_samples(measured.path, grasp)
        if len(grasp.time_s) < MIN_SAMPLES:
            raise MeasurementError(
                f"{place(measured.path, grasp)}: {len(grasp.time_s)} samples are too few, {MIN_SAMPLES} are needed;"
                " is a sample here called a grasp? else remove it"
            )
    if half_opening_m is None:
        half_opening_m = abs(open_m - closed_m) if measured.columns.unit == "m" else math.inf
    warnings = check_units(measured, open_m, closed_m, half_opening_m)
    warnings += check_liveness(measured, abs(open_m - closed_m))
    if pads_at is None and measured.columns.are_pads:
        pads_at = np.asarray
    for motor in range(len(measured.columns.position)):
        refuse_copied_command(measured, motor)
    check_signs(measured, open_m, closed_m, pads_at, half_opening_m)
    if pads_at is not None and measured.columns.force and not measured.columns.read_effort:
        warnings += check_starts(measured, pads_at, half_opening_m)
    if len(measured.grasps) == 1:
        warnings.append(f"{show(measured.path)}: {ALONE}")
    return [*measured.notes, *warnings, *_gaps(measured), *check_copies(measured), *check_repeats(measured)]


def check_table(table: FinalForceTable, open_m: float) -> list[str]:
    """Checks a table of final forces against a gripper that opens ``open_m``; returns warnings as :func:`check_set`."""
    path = table.path / "table.csv"
    delta, force = table.delta_q_m, table.final_force_n
    wrong = np.abs(delta) > 3 * abs(open_m)
    if wrong.any():
        index = int(wrong.argmax())
        raise MeasurementError(
            f"{show(path)}: row {index + 2}, column delta_q_m: {delta[index]:g} where the gripper opens {open_m:g} m:"
            " looks like millimetres, divide by 1000"
        )
    check_forces(force, lambda index: f"{show(path)}: row {index + 2}, column final_force_n")
    check_force_noise(table.path, table.force_std_n, force)
    if not force.any():
        raise MeasurementError(f"{show(path)}: column final_force_n: all forces are zero; is the sensor connected?")
    if len(delta) > 2 and np.ptp(delta) > 0 and np.ptp(force) > 0 and np.corrcoef(delta, force)[0, 1] < -0.8:
        raise MeasurementError(
            f"{show(path)}: column final_force_n: falls as delta_q_m grows; larger deltas must press harder, with f ≥ 0"
        )
    counts = {name: table.objects.count(name) for name in dict.fromkeys(table.objects)}
    few = [f"{show(path)}: object {show(name)} has {n} rows only" for name, n in counts.items() if n < 3]
    return [*table.notes, *few]


def _gaps(measured: MeasurementSet) -> list[str]:
    warnings = []
    for grasp in measured.grasps:
        steps = np.diff(grasp.time_s)
        longest = int(steps.argmax())
        if steps[longest] > _GAP * np.median(steps):
            warnings.append(
                f"{place(measured.path, grasp, longest + 1, 't_s')}: a gap of {steps[longest]:.3g} s where samples are"
                f" {np.median(steps):.3g} s apart; it stays a gap"
            )
    return warnings
