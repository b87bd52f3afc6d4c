"""Does the noise that is given with a set fit what its readings show?"""

from __future__ import annotations

import numpy as np

from forcegrasp.compare.quantised import find_step
from forcegrasp.compare.target import UNITS, third_differences
from forcegrasp.errors import MeasurementError
from forcegrasp.measure.folder import show
from forcegrasp.measure.schema import MeasuredGrasp, MeasurementSet

#: Noise further than this from what the readings show is told, or refused.
TELL, REFUSE = 1.5, 10.0
# Noise that is correlated over less than this still shows in full, seconds.
_SLOW_S = 0.1
# Fewer windows than this, per sensor, say nothing.
_LEAST_WINDOWS = 60


def check_given_noise(measured: MeasurementSet) -> list[str]:
    """Holds ``position_std_m`` and ``force_std_n`` against the readings; returns a warning for each that is odd.

    Raises:
      MeasurementError: if one is more than ten times what the readings show, or less than a tenth of it.
    """
    warnings = []
    for key, given, first in (("position_std_m", measured.position_std_m, 0), ("force_std_n", measured.force_std_n, 2)):
        if given is None:
            continue
        readings = [(g.position_m, g.force_n)[first // 2] for g in measured.grasps]
        least, most = noise_range(measured.grasps, readings, given)
        apart, shown = (given / most, most) if given > most else (least / given, least)
        if not apart > TELL:
            continue
        unit, side = UNITS[first], "more" if given > most else "less"
        line = (
            f"{show(measured.path / 'meta.yaml')}: {key}: {given:.3g} {unit} is {apart:.3g} times {side} than the"
            f" {shown:.2g} {unit} that the readings show while the command is held"
        )
        if apart > REFUSE:
            raise MeasurementError(f"{line}; correct it, in {unit}, or leave it out to have it estimated")
        warnings.append(f"{line}; every error is told as a multiple of what is given")
    return warnings


def noise_range(
    grasps: tuple[MeasuredGrasp, ...], readings: list[np.ndarray], given: float
) -> tuple[float, float]:
    """The least and the most noise that readings show; 0 and infinity where they can't tell.

    The least is what jitters from sample to sample, less what rounding accounts for. The most counts slower noise, too,
    and only where a reading changes at all: dead zones, stops and steps of a converter hide noise.

    Args:
      grasps: that the readings are of.
      readings: of the two sensors of one kind, each ``(T, 2)``.
      given: noise that is given, in their unit.
    """
    fast, slow = [], []
    for grasp, signals in zip(grasps, readings, strict=True):
        interval = float(np.median(np.diff(grasp.time_s)))
        fast.append(third_differences(grasp, signals, 1))
        slow.append(third_differences(grasp, signals, max(1, round(_SLOW_S / interval))))
    least, most = [], []
    for finger in range(2):
        jitter = [windows[held, finger] for windows, held in fast]
        least.append(_spread(np.concatenate(jitter)))
        held = np.concatenate([windows[held, finger] for windows, held in slow])
        some = held if np.count_nonzero(held) >= _LEAST_WINDOWS else np.concatenate([w[:, finger] for w, _ in slow])
        most.append(_spread(some[some != 0]))
    step = find_step(np.concatenate([signals.ravel() for signals in readings]))
    rounding = step / np.sqrt(12)
    lowest = min(least)
    return (np.sqrt(lowest**2 - rounding**2) if lowest > 2*rounding else 0.0), max(max(most), rounding) if max(most) > 0 else np.inf


def _spread(windows: np.ndarray) -> float:
    """Noise that makes third differences like these; 0 if they are too few."""
    return 1.4826 * float(np.median(np.abs(windows))) / np.sqrt(20) if len(windows) >= _LEAST_WINDOWS else 0.0
