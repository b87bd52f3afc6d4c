"""Cuts long recordings into windows that are simulated side by side, each from where the servo was measured to be."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np

from forcegrasp.measure.schema import MeasuredGrasp

#: Longest window, and its shortest: so many fit into a set, for some are held out. Seconds.
LONGEST_S, SHORTEST_S, LEAST_WINDOWS = 1.0, 0.3, 12
#: The first part of a window is simulated but does not count: what is not known of its start (the memory of effects,
#: errors of position and velocity) fades meanwhile. Seconds.
WARM_UP_S = 0.2
# Samples, and seconds at least, that a start's position and velocity are estimated from, by a parabola through them.
_AROUND, _AROUND_S = 4, 0.02
#: Most windows of a set; of longer recordings they are spread evenly.
MOST_WINDOWS = 240


def cut(recordings: Sequence[MeasuredGrasp]) -> tuple[MeasuredGrasp, ...]:
    """Windows of recordings, in order; of very many they are spread evenly."""
    total = sum(float(one.time_s[-1] - one.time_s[0]) for one in recordings)
    length = min(LONGEST_S, max(SHORTEST_S, total / LEAST_WINDOWS))
    windows = [window for one in recordings for window in _windows(one, length)]
    if len(windows) <= MOST_WINDOWS:
        return tuple(windows)
    kept = np.unique(np.linspace(0, len(windows) - 1, MOST_WINDOWS).round().astype(int))
    return tuple(windows[i] for i in kept)


def _windows(one: MeasuredGrasp, length: float) -> list[MeasuredGrasp]:
    time = one.time_s - one.time_s[0]
    warm_up = min(WARM_UP_S, length / 2)
    found = []
    for index in range(max(1, math.ceil((time[-1] - warm_up) / length - 0.5))):
        low, high = np.searchsorted(time, [index * length - 1e-9, (index + 1) * length + warm_up])
        if high - low > 2 * _AROUND:
            found.append(_window(one, int(low), int(high), warm_up))
    return found


def _window(one: MeasuredGrasp, low: int, high: int, warm_up: float) -> MeasuredGrasp:
    part = slice(low, high)
    time = one.time_s[part] - one.time_s[low]
    return dataclasses.replace(
        one,
        name=f"{one.name} {one.time_s[low] - one.time_s[0]:.1f} s",
        time_s=time,
        command_m=one.command_m[part],
        position_m=one.position_m[part],
        force_n=one.force_n[part],
        rows=None if one.rows is None else one.rows[part],
        enabled=None if one.enabled is None else one.enabled[part],
        load=None if one.load is None else one.load[part],
        start=_state(one, low),
        counts=time >= warm_up,
    )


def _state(one: MeasuredGrasp, index: int) -> tuple[np.ndarray, np.ndarray]:
    """Position and velocity at a sample, from a parabola through the samples around it, each ``(motors,)``."""
    step = float(np.median(np.diff(one.time_s)))
    around = max(_AROUND, round(_AROUND_S / step))
    low, high = max(0, index - around), min(len(one.time_s), index + around + 1)
    time = one.time_s[low:high] - one.time_s[index]
    curves = np.polynomial.polynomial.polyfit(time, one.position_m[low:high], 2)
    return curves[0], curves[1]
