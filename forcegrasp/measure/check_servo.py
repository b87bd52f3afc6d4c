"""Can a set of a servo be right? Refuses what no physical effect explains, warns of what is odd."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from forcegrasp.errors import MeasurementError
from forcegrasp.measure.check_commands import check_efforts, check_order, check_relation
from forcegrasp.measure.folder import show
from forcegrasp.measure.samples import MIN_SAMPLES, check_samples, place
from forcegrasp.measure.schema import MeasuredGrasp, MeasurementSet

# Motion of so many times what the mechanism usually does is in another unit, of so many worth a question.
_OTHER_UNIT, _ODD = 25, 8
_MISTAKEN = {
    "rad": "looks like degrees or counts; say the unit, or multiply by π/180 (counts: by 2π ÷ counts of a turn)",
    "m": "looks like millimetres or counts; say the unit, or divide by 1000",
}
# Of so many different whole numbers positions in radians or metres never consist; nor commands, if they are this large.
_WHOLE, _LARGE = 8, 20.0
# Seconds between samples: more, or fewer, are in another unit.
_SLOWEST, _FASTEST = 0.5, 2e-5
_CLOCKS = ((5e5, "nanoseconds"), (500.0, "microseconds"), (_SLOWEST, "milliseconds"))
# Nothing that turns or slides is that fast: rad/s, m/s; over so many samples at least, for encoders are coarse.
_TOO_FAST, _SPEED_OVER = {"rad": 500.0, "m": 50.0}, 10
# A pause of so many times the usual time between samples is worth a warning, if it is as long as this, s.
_GAP, _GAP_S = 5, 0.1
# A servo that does not move while its command moves by this share of all motion has an encoder that was not read.
_STUCK = 0.2


def check_servo(
    measured: MeasurementSet, spans: Sequence[float], unsigned: bool = False, settings: Collection[str] = ()
) -> list[str]:
    """Checks the recordings of a set; returns warnings, one line each.

    Args:
      measured: the set.
      spans: how far each motor of the mechanism usually moves, m or rad.
      unsigned: whether efforts are sizes without a sign.
      settings: what the scene takes from recordings, such as the mass of a load.

    Raises:
      MeasurementError: where, why, and what to do.
    """
    warnings = []
    for one in measured.grasps:
        check_samples(measured.path, one)
        if len(one.time_s) < MIN_SAMPLES:
            count = len(one.time_s)
            raise MeasurementError(
                f"{place(measured.path, one)}: {count} samples are too few, {MIN_SAMPLES} are needed; leave it out"
            )
        warnings += _check_clock(measured, one)
    for joint in range(len(measured.columns.position)):
        warnings += _check_still(measured, joint)
        warnings += check_relation(measured, joint, spans[joint])
        for one in measured.grasps:
            warnings += _check_units(measured, one, joint, spans[joint])
    check_order(measured)
    return [*measured.notes, *_unsaid(measured, settings), *warnings, *check_efforts(measured, unsigned)]


def _unsaid(measured: MeasurementSet, settings: Collection[str]) -> list[str]:
    """Warns of what the scene would take from the recordings, and they do not say."""
    unsaid = [name for name in settings if not any(name in one.settings for one in measured.grasps)]
    if not unsaid:
        return []
    columns = f"{'column' if len(unsaid) == 1 else 'columns'} {', '.join(unsaid)}"
    return [f"{show(measured.path)}: recordings.csv has no {columns}; the scene's own stands for all"]


def _check_clock(measured: MeasurementSet, one: MeasuredGrasp) -> list[str]:
    """Raises MeasurementError about times in another unit; warns of gaps."""
    step = np.diff(one.time_s)
    usual, longest = float(np.median(step)), int(step.argmax())
    where = place(measured.path, one, None, "t_s")
    for above, unit in _CLOCKS:
        if usual > above:
            raise MeasurementError(f"{where}: samples are {usual:.3g} s apart: looks like {unit}; say the time's unit")
    if usual < _FASTEST:
        raise MeasurementError(
            f"{where}: samples are {usual:.3g} s apart: looks like seconds that were taken for milliseconds or less;"
            " say the time's unit"
        )
    unit = one.columns.unit
    reach = min(_SPEED_OVER, len(step))
    moved = np.abs(one.position_m[reach:] - one.position_m[:-reach]).max(axis=1)
    speed = float(np.quantile(moved / (one.time_s[reach:] - one.time_s[:-reach]), 0.9))
    if speed > _TOO_FAST[unit]:
        raise MeasurementError(
            f"{where}: moves by {speed:.3g} {unit}/s: looks like seconds that were taken for milliseconds or less, or"
            " positions in another unit; say the units"
        )
    if step[longest] > max(_GAP * usual, _GAP_S):
        return [
            f"{place(measured.path, one, longest + 1, 't_s')}: a gap of {step[longest]:.3g} s where samples are"
            f" {usual:.3g} s apart; what comes after it starts anew"
        ]
    return []


def _check_units(measured: MeasurementSet, one: MeasuredGrasp, joint: int, span: float) -> list[str]:
    """Raises MeasurementError about positions or commands in another unit; warns of large ones."""
    unit, columns = one.columns.unit, one.columns
    pairs = [(columns.position[joint], one.position_m[:, joint], 0.0)]
    if columns.command[joint].startswith("qdes"):
        pairs.append((columns.command[joint], one.command_m[:, joint], _LARGE))
    for name, values, at_least in pairs:
        where, moved = place(measured.path, one, None, name), float(np.ptp(values))
        whole = np.unique(values)
        if len(whole) >= _WHOLE and np.array_equal(whole, np.round(whole)) and np.abs(whole).max() > at_least:
            raise MeasurementError(f"{where}: whole numbers up to {np.abs(whole).max():g}: {_MISTAKEN[unit]}")
        if moved > _OTHER_UNIT * span:
            raise MeasurementError(
                f"{where}: moves by {moved:.4g} {unit} where {measured.gripper} usually moves by {span:g}:"
                f" {_MISTAKEN[unit]}; or correct the mechanism's span"
            )
    moved = float(np.ptp(pairs[0][1]))
    if moved > _ODD * span:
        where = place(measured.path, one, None, pairs[0][0])
        return [
            f"{where}: moves by {moved:.3g} {unit} where {measured.gripper} usually moves by {span:g}; is it in {unit}?"
        ]
    return []


def _check_still(measured: MeasurementSet, joint: int) -> list[str]:
    """Raises MeasurementError about columns that never change where they must; warns of recordings that say nothing."""
    columns, warnings = measured.columns, []
    largest = max(float(np.ptp(one.position_m[:, joint])) for one in measured.grasps)
    if largest == 0:
        where = f"{show(measured.path)}: column {columns.position[joint]}"
        raise MeasurementError(f"{where}: never changes; is it the right column, and was the encoder read?")
    if all(np.ptp(g.command_m[:, joint]) == 0 and g.enabled is None and g.load is None for g in measured.grasps):
        raise MeasurementError(
            f"{show(measured.path)}: column {columns.command[joint]}: never changes; is it the right column?"
        )
    is_position = columns.command[joint].startswith("qdes")
    for one in measured.grasps:
        if np.ptp(one.position_m[:, joint]) > 0:
            continue
        where = place(measured.path, one, None, columns.position[joint])
        if is_position and np.ptp(one.command_m[:, joint]) > _STUCK * largest and _is_on(one):
            raise MeasurementError(f"{where}: never changes while its command moves; was the encoder read?")
        warnings.append(f"{where}: never changes; this recording tells nothing of motion")
    return warnings


def _is_on(one: MeasuredGrasp) -> bool:
    return one.enabled is None or bool(np.mean(np.asarray(one.enabled, float) > 0) > 0.5)
