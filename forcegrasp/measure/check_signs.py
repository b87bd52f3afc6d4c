"""Checks the closing direction, the sign of forces, and left against right. Refuses only what no effect explains."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence

import numpy as np

from forcegrasp.errors import MeasurementError
from forcegrasp.measure.check_commands import correlation
from forcegrasp.measure.check_liveness import feels, force_noise, without_trend
from forcegrasp.measure.samples import place
from forcegrasp.measure.schema import MeasuredGrasp, MeasurementSet, side_of

PadsAt = Callable[[np.ndarray], np.ndarray | None]
#: Positions may lag behind commands by any of these, in seconds.
_LAGS = (0.0, 0.05, 0.1, 0.2, 0.4, 0.8)
# Two motors are told different things if that changes by this share of their range; positions are crossed if their
# difference goes the other way, with a correlation like this, and more so than the same way.
_APART, _CROSSED = 0.05, 0.3
# What positions and commands change in so many rows is compared this many rows apart, either way; and what is clearly
# less than something else is so by this share.
_WINDOW, _ROWS, _CLEARLY = 4, 8, 0.7
# Share of the stroke by which no motor comes to stand past closed.
_PAST_CLOSED = 0.1
# Seconds by which one finger is felt before the other if it touches first, where nothing but this tells so.
_LEAD_S = 0.3


def check_signs(
    measured: MeasurementSet, open_m: float, closed_m: float, pads_at: PadsAt | None, half_opening_m: float
) -> None:
    """Raises MeasurementError if a closing direction, the sign of a force, or the fingers are the wrong way round.

    Args:
      measured: the set.
      open_m, closed_m: positions of a motor, m or rad.
      pads_at: from positions of the motors to where the pads stand; None if that is not known.
      half_opening_m: how far a pad stands from the middle of the open gripper.
    """
    reach = open_m - closed_m
    for motor in range(len(measured.columns.position)):
        _check_follows(measured, motor, abs(reach))
        _check_leads(measured, motor, abs(reach))
    if len(measured.columns.position) == len(measured.columns.command) == 2:
        _check_own_commands(measured, abs(reach))
    if measured.columns.read_effort:
        _check_effort(measured, closed_m, reach)
    for channel in range(0 if measured.columns.read_effort else len(measured.columns.force)):
        _check_presses(measured, channel, closed_m, reach)
    if pads_at is None or not measured.columns.force or measured.columns.read_effort:
        # an effort is of no finger, and felt in free air
        return
    placed = [pads_at(grasp.position_m) for grasp in measured.grasps]
    pads = [places for places in placed if places is not None]
    if len(pads) < len(placed):
        return
    if len(measured.columns.force) == 2:
        _check_fingers(measured, pads, half_opening_m)
    for grasp, places in zip(measured.grasps, pads, strict=True):
        _check_free_air(measured, grasp, places, half_opening_m)


def _check_follows(measured: MeasurementSet, motor: int, reach: float) -> None:
    """Positions must not run against commands that cover a good part of the range, whatever the delay."""
    against = []
    for grasp in measured.grasps:
        command, position = grasp.command_m[:, motor], grasp.position_m[:, motor]
        if np.ptp(command) < 0.2 * reach or np.ptp(position) < 0.2 * np.ptp(command):
            continue
        found = [correlation(position, _held(grasp.time_s, command, grasp.time_s - lag)) for lag in _LAGS]
        if min(found) < -0.7 and max(found) < 0.5:
            against.append((min(found), grasp))
    if against and (min(lowest for lowest, _ in against) < -0.9 or len(against) > 1):
        raise MeasurementError(
            f"{place(measured.path, against[0][1], 0, measured.columns.position[motor])}: runs against"
            f" {measured.columns.command[motor]}; both must be 0 when closed and grow when opening"
        )


def _check_leads(measured: MeasurementSet, motor: int, reach: float) -> None:
    """What is read comes after what was commanded, and is what jitters: the other way round the columns are swapped."""
    moved = [g for g in measured.grasps if np.ptp(g.command_m[:, motor]) > 0.2 * reach and len(g.time_s) > 4 * _ROWS]
    if not moved:
        return
    changes, jitter = [], []
    for grasp in moved:
        both = np.stack([grasp.command_m[:, motor], grasp.position_m[:, motor]])
        changes.append(both[:, _WINDOW:] - both[:, :-_WINDOW])
        jitter.append(np.median(np.abs(np.diff(both, 3)), axis=1))
    unlike = [1 - _alike(changes, row) for row in range(-_ROWS, _ROWS + 1)]  # positions, so many rows later
    leads = min(unlike[:_ROWS]) < _CLEARLY * min(unlike[_ROWS:])
    of_command, of_position = np.median(jitter, axis=0)
    if leads and of_position < _CLEARLY * of_command:
        raise MeasurementError(
            f"{place(measured.path, moved[0], 0, measured.columns.position[motor])}: moves before"
            f" {measured.columns.command[motor]} does; are the two swapped?"
        )


def _alike(changes: Sequence[np.ndarray], row: int) -> float:
    """Correlation of what commands and positions change, ``(2, T)`` of each grasp, the latter so many rows later."""
    pairs = [(c[max(0, -row) : len(c) - max(0, row)], p[max(0, row) : len(p) + min(0, row)]) for c, p in changes]
    return correlation(np.concatenate([c for c, _ in pairs]), np.concatenate([p for _, p in pairs]))


def _check_own_commands(measured: MeasurementSet, reach: float) -> None:
    """Where two motors are told different things each must do its own."""
    crossed, right = [], 0
    for grasp in measured.grasps:
        apart = grasp.command_m[:, 0] - grasp.command_m[:, 1]
        if np.ptp(apart) < _APART * reach:
            continue
        stand = grasp.position_m[:, 0] - grasp.position_m[:, 1]
        found = [correlation(stand, _held(grasp.time_s, apart, grasp.time_s - lag)) for lag in _LAGS]
        if -min(found) > max(_CROSSED, *found):
            crossed.append(grasp)
        else:
            right += 1
    if len(crossed) > right:
        one, other = measured.columns.position
        raise MeasurementError(
            f"{place(measured.path, crossed[0], 0, one)}: follows the commands of {other}, and that its own;"
            " swap the columns of the positions or of the commands"
        )


def _check_effort(measured: MeasurementSet, closed_m: float, reach: float) -> None:
    """A motor's effort must close while it is commanded to close further than it is, moving or not.

    The command of its own row acts after it was read, that of the row before until then. Motors that come to stand
    beyond where they are closed give away that positions and commands are counted the other way round.
    """
    efforts = np.concatenate([g.force_n[1:, 0] for g in measured.grasps])
    own = np.concatenate([(g.position_m[1:] - g.command_m[1:])[:, 0] for g in measured.grasps])
    before = np.concatenate([(g.position_m[1:] - g.command_m[:-1])[:, 0] for g in measured.grasps])
    found = [correlation(efforts, behind) for behind in (own, before)]
    if min(found) < -0.5 and max(found) < 0.5:
        columns, first = measured.columns, measured.grasps[0]
        closest = min(float(((grasp.position_m[:, 0] - closed_m) / reach).min()) for grasp in measured.grasps)
        if closest < -_PAST_CLOSED:
            raise MeasurementError(
                f"{place(measured.path, first, 0, columns.position[0])}: positions go {-closest:.0%} of the stroke past"
                f" closed; they and {columns.command[0]} must be 0 when closed and grow when opening"
            )
        raise MeasurementError(
            f"{place(measured.path, first, 0, columns.force[0])}: opens while the command is to close; f ≥ 0 presses,"
            " multiply them by -1; or q = 0 must be closed"
        )


def _check_presses(measured: MeasurementSet, channel: int, closed_m: float, reach: float) -> None:
    """Forces must grow as commands close; asked session by session, of grasps in which this channel feels much."""
    columns = measured.columns
    largest = max(
        (_span(grasp.force_n[:, k])[2] for grasp in measured.grasps for k in range(len(columns.force))), default=0.0
    )
    sessions: dict[str, list[MeasuredGrasp]] = defaultdict(list)
    for grasp in measured.grasps:
        force = grasp.force_n[:, channel]
        least = max(0.2 * largest, 8 * force_noise(force, measured.force_std_n))
        if _span(force)[2] > least and feels(grasp.force_n)[channel]:
            sessions[grasp.session].append(grasp)
    for grasps in sessions.values():
        first = grasps[0]
        if _wrong_way([_answer(g, g.force_n[:, channel], g.command_m.mean(axis=1) / reach) for g in grasps]):
            low, high, _ = _span(first.force_n[:, channel])
            if -low > high:
                what, todo = "pressing gives negative forces", "multiply them by -1: f ≥ 0 presses"
            else:
                what, todo = "grows while the fingers open", "the closing direction is wrong: q = 0 must be closed"
            raise MeasurementError(f"{place(measured.path, first, 0, columns.force[channel])}: {what}; {todo}")
        if not columns.are_pads:
            continue
        # One finger the wrong way round leaves the mean of both commands as it is; but then it starts closed.
        starts = [(g.position_m[0, [channel, 1 - channel]] - closed_m) / reach for g in grasps]
        if all(own < 0.25 and other > 0.6 for own, other in starts) and _wrong_way(
            [_answer(g, g.force_n[:, channel], g.command_m[:, channel] / reach) for g in grasps]
        ):
            raise MeasurementError(
                f"{place(measured.path, first, 0, columns.position[channel])}:"
                f" the {side_of(columns.force[channel])} finger presses more"
                " the further it opens; the closing direction is wrong: q = 0 must be closed"
            )


def _answer(grasp: MeasuredGrasp, force: np.ndarray, command: np.ndarray) -> np.ndarray:
    """How force and opening change together, at each lag: sums of products and squares, ``(2, lags, 3)``.

    First as they are; then less the force's line over the whole grasp, lest a strong drift pass for an answer.
    """
    time = grasp.time_s
    window = min(max(0.3, 3 * float(np.median(np.diff(time)))), (time[-1] - time[0]) / 8)

    def change(values: np.ndarray, lag: float) -> np.ndarray:
        return _held(time, values, time - lag) - _held(time, values, time - lag - window)

    forces = [change(force, 0.0), change(without_trend(force, time), 0.0)]
    opened = [change(command, lag) for lag in _LAGS]
    return np.array([[[f @ opening, f @ f, opening @ opening] for opening in opened] for f in forces])


def _wrong_way(answers: list[np.ndarray]) -> bool:
    """Whether forces clearly grow with opening, all grasps together; a lag may hide, but not reverse this."""
    product, force, opening = np.moveaxis(np.sum(answers, axis=0), 2, 0)
    alike = product / np.sqrt(np.maximum(force * opening, 1e-300))
    as_read, without_drift = alike
    return bool(as_read.max() > max(0.2, -2 * as_read.min()) and without_drift.max() > max(0.0, -without_drift.min()))


def _check_fingers(measured: MeasurementSet, pads: list[np.ndarray], reach: float) -> None:
    """An object off to the right is touched by the right finger first, if both close alike."""
    right, wrong = [], []
    alive = np.any([feels(grasp.force_n) for grasp in measured.grasps], axis=0).all()
    for grasp, places in zip(measured.grasps, pads, strict=True):
        offset = grasp.offset_m
        if offset is None or abs(offset) < 0.05 * reach:
            continue
        onsets = [_onset(grasp.time_s, force, measured.force_std_n) for force in grasp.force_n.T]
        touched = [onset for onset in onsets if onset is not None]
        if not touched or (len(touched) == 1 and (grasp.radius_m is None or not alive)):
            continue
        first = min(touched)
        left_at, right_at = (np.inf if onset is None else grasp.time_s[onset] for onset in onsets)
        unlike = np.ptp(grasp.command_m[: first + 1], axis=1).max() > 0.02 * reach
        unlike |= np.ptp(places[first]) > 0.05 * reach
        lead, rows = abs(left_at - right_at), 2 * float(np.median(np.diff(grasp.time_s)))
        if unlike or lead < rows:
            continue
        if (left_at < right_at) == (offset < 0):
            right.append(grasp)
        elif _too_open_for_both(grasp, places[first], reach) or (grasp.radius_m is None and lead > _LEAD_S + 3 * rows):
            wrong.append(grasp)
    if len(wrong) > 1 and len(wrong) >= 0.8 * len(wrong + right):
        raise MeasurementError(
            f"{place(measured.path, wrong[0], 0, measured.columns.force[0])}: the wrong finger touches"
            f" first in {len(wrong)} of {len(wrong + right)} off-centre grasps; are left and"
            " right swapped? or correct object_offset_m"
        )


def _check_free_air(measured: MeasurementSet, grasp: MeasuredGrasp, pads: np.ndarray, reach: float) -> None:
    """Before a finger can touch, forces may be biased and drift, but not fluctuate as if grasping."""
    if grasp.radius_m is None or grasp.offset_m is None:
        return
    surface = grasp.radius_m + np.array([-1.0, 1.0]) * grasp.offset_m
    near = np.any(pads - surface < 0.15 * reach, axis=1)
    free = int(near.argmax()) if near.any() else len(near)
    if free < 10 or len(near) - free < 10:
        return
    largest = max(_span(force)[2] for force in grasp.force_n[free:].T)
    for finger, force in enumerate(grasp.force_n.T):
        rest = without_trend(force[:free], grasp.time_s[:free])
        noise = force_noise(force[free:], measured.force_std_n)
        crossings = np.count_nonzero(np.diff(np.signbit(rest)))
        if np.std(rest) > max(15 * noise, 0.2 * largest) and crossings > 3:
            index = int(np.abs(rest).argmax())
            raise MeasurementError(
                f"{place(measured.path, grasp, index, grasp.columns.force[finger])}: {force[index]:.3g} N in free"
                f" air, where forces fluctuate by {np.std(rest):.2g} N; cut it out, or correct object_radius_m or"
                " object_offset_m"
            )


def _span(force: np.ndarray) -> tuple[float, float, float]:
    """Low, high and their difference, without the outermost 2 % at either end."""
    low, high = np.quantile(force, (0.02, 0.98)).tolist()
    return low, high, high - low


def _held(time: np.ndarray, command: np.ndarray, at: np.ndarray) -> np.ndarray:
    """The command in force at some times; before the first sample, the first."""
    return command[np.maximum(np.searchsorted(time, at, side="right") - 1, 0)]


def _onset(time: np.ndarray, force: np.ndarray, std: float | None) -> int | None:
    """Index of the first of three samples in a row at which the force has clearly grown of late, or None."""
    window = max(0.25, 5 * float(np.median(np.diff(time))))
    grown = force - force[np.searchsorted(time, time - window)]
    above = grown > max(8 * force_noise(force, std), 0.05 * _span(force)[2])
    run = above[:-2] & above[1:-1] & above[2:]
    return int(run.argmax()) if run.any() else None


def _too_open_for_both(grasp: MeasuredGrasp, places: np.ndarray, reach: float) -> bool:
    """Whether the fingers are too far apart for the object to be between both: just one of them can touch it."""
    if grasp.radius_m is None or grasp.offset_m is None:
        return False
    spare = 0.03 * reach + 0.5 * abs(grasp.offset_m)
    return bool(places.sum() > 2 * grasp.radius_m + spare)
