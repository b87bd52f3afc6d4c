"""Cuts long recordings into windows that are simulated side by side, each from where the servo was measured to be."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Sequence

import numpy as np
from scipy.signal import savgol_filter

from forcegrasp.measure.schema import MeasuredGrasp
from forcegrasp.physics.gripper_parts import BaseParameter

#: Longest window, and its shortest: so many fit into a set, for some are held out. Seconds.
LONGEST_S, SHORTEST_S, LEAST_WINDOWS = 1.0, 0.3, 12
#: Of slow logs windows are longer: so many samples.
LEAST_SAMPLES = 40
#: Nothing is simulated across a gap of so many times the usual time between samples, and so many seconds at least.
GAP, GAP_S = 5, 0.1
#: The first part of a window is simulated but does not count: what is not known of its start (errors of position and
#: velocity, what elastic parts store) fades meanwhile. Seconds.
WARM_UP_S = 0.4
#: Effects remember commands and motion of so long before a window: a ramp to an earlier command may take that long.
REMEMBERED_S = 3.0
# Samples, and seconds at least, that a start's position and velocity are estimated from, by a parabola through them.
_AROUND, _AROUND_S = 4, 0.02
# A window starts at the best of so many samples around its turn. Its clock may be off by so many seconds: where a servo
# is slow that matters least.
_CANDIDATES, _UNSURE_S = 15, 0.01
# A servo rests at first if it moves less than this share of what it moves in one of the samples soon after.
_RESTED = 0.1
#: Most windows of a set, and the share of them at least that something moves in, if there are so many.
MOST_WINDOWS, MOVING = 120, 0.75
# Something moves in a window if a joint goes further than this share of all that it goes.
_MOVES = 0.01


def cut(recordings: Sequence[MeasuredGrasp], skew: BaseParameter | None = None) -> tuple[MeasuredGrasp, ...]:
    """Windows of recordings, in order; of very many most of those that something moves in, spread evenly.

    Args:
      recordings: each from its start to its end.
      skew: how much later than its command a sample was read, if it may have been: windows start that much before what
        was read, and go on after the samples that count, for further commands act before these are read.
    """
    total = sum(float(one.time_s[-1] - one.time_s[0]) for one in recordings)
    step = float(np.median(np.concatenate([np.diff(one.time_s) for one in recordings])))
    length = max(min(LONGEST_S, max(SHORTEST_S, total / LEAST_WINDOWS)), LEAST_SAMPLES * step)
    windows = [
        window for one in recordings for part in _without_gaps(one) for window in _windows(one, part, length, skew)
    ]
    if len(windows) <= MOST_WINDOWS:
        return tuple(windows)
    span = np.ptp(np.concatenate([one.position_m for one in recordings]), axis=0)
    moving = np.array([np.any(np.ptp(window.position_m, axis=0) > _MOVES * span) for window in windows])
    most = min(int(moving.sum()), max(MOST_WINDOWS - int((~moving).sum()), round(MOVING * MOST_WINDOWS)))
    kept = [_spread(np.flatnonzero(moving), most), _spread(np.flatnonzero(~moving), MOST_WINDOWS - most)]
    return tuple(windows[i] for i in np.sort(np.concatenate(kept)))


def _spread(indices: np.ndarray, count: int) -> np.ndarray:
    """So many of these, evenly spread."""
    return indices[np.linspace(0, len(indices) - 1, min(count, len(indices))).round().astype(int)]


def _without_gaps(one: MeasuredGrasp) -> list[slice]:
    """The parts of a recording between gaps in time."""
    step = np.diff(one.time_s)
    gaps = np.flatnonzero(step > max(GAP_S, GAP * float(np.median(step)))) + 1
    return [slice(low, high) for low, high in itertools.pairwise([0, *gaps.tolist(), len(one.time_s)])]


def _windows(recording: MeasuredGrasp, part: slice, length: float, skew: BaseParameter | None) -> list[MeasuredGrasp]:
    one = _cut_out(recording, part)
    time, began = one.time_s - one.time_s[0], float(one.time_s[0] - recording.time_s[0])
    if len(time) <= 2 * _AROUND:
        return []
    warm_up, smooth = min(WARM_UP_S, length / 2), _smoothed(one)
    noise = 1.4826 * np.median(np.abs(one.position_m - smooth), axis=0)
    count = max(1, math.ceil((time[-1] - warm_up) / length - 0.5))
    lows = [0, *(_start_near(one, index * length, length / 4) for index in range(1, count)), len(time)]
    usual, most = (skew.nominal, max(0.0, skew.high)) if skew else (0.0, 0.0)
    found = []
    for low, next_low in itertools.pairwise(lows):
        end = min(time[low] + length, time[next_low] if next_low < len(time) else np.inf) + warm_up
        last, high = np.searchsorted(time, [end, end + most])
        since = time[low:high] - time[low]
        counts = (since >= warm_up) & (np.arange(low, high) < last)
        if counts.sum() > _AROUND:
            window, name = _cut_out(one, slice(low, int(high))), f"{one.name} {began + time[low]:.1f} s"
            start, unsure = _state(one, low, usual, noise)
            earlier = slice(int(np.searchsorted(time, time[low] - REMEMBERED_S)), low)
            before = time[earlier] - time[low], one.command_m[earlier], smooth[earlier]
            found.append(
                dataclasses.replace(
                    window, name=name, time_s=since, start=start, start_std=unsure, counts=counts, before=before
                )
            )
    return found


def _smoothed(one: MeasuredGrasp) -> np.ndarray:
    """Positions with less noise, by a parabola through the samples around each, m or rad, ``(T, motors)``."""
    return np.asarray(savgol_filter(one.position_m, 2 * _reach(one) + 1, 2, axis=0))


def _start_near(one: MeasuredGrasp, middle: float, reach: float) -> int:
    """The sample near a time, seconds from the first, at which position and velocity are known best."""
    low, high = np.searchsorted(one.time_s - one.time_s[0], [middle - reach, middle + reach])
    places = np.unique(np.linspace(low, max(low, high - 1), _CANDIDATES).round().astype(int))
    return int(min(places, key=lambda index: _doubt(one, index)))


def _doubt(one: MeasuredGrasp, index: int) -> float:
    """How badly the state at a sample is known, m or rad: what a parabola leaves, and how far it moves meanwhile."""
    curves, left, _ = _parabola(one, index)
    return float(np.max(left + _UNSURE_S * np.abs(curves[1])))


def _cut_out(one: MeasuredGrasp, part: slice) -> MeasuredGrasp:
    """Some of the samples of a recording."""
    return dataclasses.replace(
        one,
        time_s=one.time_s[part],
        command_m=one.command_m[part],
        position_m=one.position_m[part],
        force_n=one.force_n[part],
        rows=None if one.rows is None else one.rows[part],
        enabled=None if one.enabled is None else one.enabled[part],
        load=None if one.load is None else one.load[part],
    )


def _state(
    one: MeasuredGrasp, index: int, skew: float, noise: np.ndarray
) -> tuple[tuple[np.ndarray, ...], tuple[np.ndarray, ...]]:
    """Position and velocity of which a sample tells that much later, and their standard errors, each ``(motors,)``.

    From a parabola through the samples around it; but a servo that sets off at once rested when its recording began.
    Windows start where it fits best, by chance, too: the usual ``noise``, ``(motors,)``, is the least that it leaves.
    """
    curves, left, spread = _parabola(one, index)
    errors = spread[:, None] * np.maximum(left, noise)
    position, velocity = curves[0] - skew * curves[1] + skew**2 * curves[2], curves[1] - 2 * skew * curves[2]
    if index == 0:
        moves = np.abs(np.diff(one.position_m[: _AROUND + 1], axis=0))
        rested = moves[0] <= _RESTED * moves.max(axis=0)
        position, velocity = np.where(rested, one.position_m[0], position), np.where(rested, 0.0, velocity)
        errors = np.where(rested, 0.0, errors)
    return (position, velocity), (errors[0], errors[1])


def _reach(one: MeasuredGrasp) -> int:
    """How many samples on either side tell of the state at one."""
    step = float(np.median(np.diff(one.time_s)))
    return min(max(_AROUND, round(_AROUND_S / step)), (len(one.time_s) - 1) // 2)


def _parabola(one: MeasuredGrasp, index: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A parabola through the samples around one, what it leaves, and its standard errors ÷ that.

    Returns:
      ``(3, motors)``, rms ``(motors,)``, ``(3,)``.
    """
    around = _reach(one)
    low, high = max(0, index - around), min(len(one.time_s), index + around + 1)
    powers = np.vander(one.time_s[low:high] - one.time_s[index], 3, increasing=True)
    curves = np.linalg.lstsq(powers, one.position_m[low:high], rcond=None)[0]
    left = np.sqrt(np.mean((one.position_m[low:high] - powers @ curves) ** 2, axis=0))
    spread = np.linalg.norm(np.linalg.pinv(powers), axis=1) * np.sqrt(len(powers) / max(len(powers) - 3, 1))
    return curves, left, spread
