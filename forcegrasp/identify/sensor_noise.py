"""Noise of the sensors, as far as readings show it, and whether the noise that is given with a set fits them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from forcegrasp.errors import MeasurementError
from forcegrasp.identify.phases import HELD_S, held_for
from forcegrasp.measure.check_copies import is_noisy
from forcegrasp.measure.folder import show
from forcegrasp.measure.rounding import find_step
from forcegrasp.measure.schema import MeasuredGrasp, MeasurementSet
from forcegrasp.measure.white_noise import white_noise

#: Noise further than this from what the readings show is warned of, or refused.
WARN, REFUSE = 1.5, 10.0
# So many times it means that a unit lacks its prefix.
_MILLI = (300.0, 3000.0)
# Noise that is correlated over less than this still shows in full, seconds.
_SLOW_S = 0.1
# Fewer windows than this, per sensor, say nothing.
_LEAST_WINDOWS = 60


def estimate_noise(
    grasps: Sequence[MeasuredGrasp], kinds: Mapping[str, slice], finest: np.ndarray | None = None
) -> np.ndarray:
    """Sensor noise of each signal from its third differences, where the command is held; ``(C,)``.

    Third differences of a smooth signal vanish and those of white noise have variance 20 σ². Channels of one kind
    share one figure. Without repeated grasps this is a lower bound: noise that is slow looks like motion.

    Args:
      grasps: that were measured.
      kinds: which signals are of one kind.
      finest: less than this is not looked at, ``(C,)``.

    Raises:
      MeasurementError: if a signal does not vary at all, or nothing is long enough.
    """
    differences: list[np.ndarray] = []
    for grasp in grasps:
        third, held = third_differences(grasp, np.concatenate([grasp.position_m, grasp.force_n], axis=1))
        differences.append(third[held] if held.sum() > 5 else third)
    third = np.concatenate(differences)
    sigma = np.zeros(third.shape[1])
    for kind, part in kinds.items():
        values = third[:, part].ravel()
        # where most of them are 0 all count
        estimate = (white_noise(values) or np.sqrt(np.mean(values**2)) / np.sqrt(20)) if len(values) else 0.0
        sigma[part] = estimate if finest is None else np.maximum(estimate, finest[part])
        if not (sigma[part] > 0).all():
            raise MeasurementError(
                f"the noise of the {kind}s can't be told from the data:"
                " give position_std_m and force_std_n in meta.yaml"
            )
    return sigma


def third_differences(grasp: MeasuredGrasp, signals: np.ndarray, stride: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Third differences ``(n, k)`` of signals ``(T, k)``, and in which of them the command is held, ``(n,)``.

    A difference is taken over samples that are ``stride`` apart.
    """
    for _ in range(3):
        signals = signals[stride:] - signals[:-stride]
    time, reach = grasp.time_s, 3 * stride
    return signals, held_for(grasp)[reach:] >= HELD_S + time[reach:] - time[:-reach]


def check_given_noise(measured: MeasurementSet, unit: str = "m") -> list[str]:
    """Holds ``position_std_m`` and ``force_std_n`` against the readings; returns a warning for each that does not fit.

    Args:
      measured: the set.
      unit: of the positions.

    Raises:
      MeasurementError: if one is more than ten times the noise of the readings, or less than a tenth of it.
    """
    warnings = []
    given = {"position_std_m": (measured.position_std_m, unit), "force_std_n": (measured.force_std_n, "N")}
    for key, (std, unit) in given.items():
        readings = [g.force_n if unit == "N" else g.position_m for g in measured.grasps]
        if std is None or not readings[0].shape[1]:
            continue
        least, most = noise_range(measured.grasps, readings)
        shown = min(max(std, least), most)
        apart = max(std / shown, shown / std)
        where = f"{show(measured.path / 'meta.yaml')}: {key}"
        line = f"{where}: {std:.3g} {unit} is given, the readings show {shown:.2g} {unit}"
        noisy = all(is_noisy([signals[:, finger] for signals in readings]) for finger in range(readings[0].shape[1]))
        if apart > REFUSE and noisy:
            raise MeasurementError(f"{line}; {_what_to_correct(std, shown, unit)}")
        if apart > WARN:
            warnings.append(f"{line}; errors are told as multiples of what is given")
    return warnings


def _what_to_correct(std: float, shown: float, unit: str) -> str:
    """What to do about a noise that is far from what the readings show: a thousand is a prefix of a unit."""
    low, high = _MILLI
    if low < shown / std < high:
        return f"are the readings in m{unit}? give them in {unit}"
    if low < std / shown < high:
        return f"is it in m{unit}? give it in {unit}"
    return f"correct it, in {unit}, or leave it out to have it estimated"


def noise_range(grasps: Sequence[MeasuredGrasp], readings: Sequence[np.ndarray]) -> tuple[float, float]:
    """The least and the most noise that the readings of sensors of one kind show; 0 and infinity where they can't tell.

    The least is what jitters from sample to sample while the command is held; steps of a converter may be all of it.
    The most counts slower noise, too, and only readings that change: stops, dead zones and steps hide noise.

    Args:
      grasps: that were read.
      readings: positions or forces of each grasp, ``(T, sensors)``.
    """
    least, most = [], []
    fast = [third_differences(g, r) for g, r in zip(grasps, readings, strict=True)]
    slow = [third_differences(g, r, _stride(g)) for g, r in zip(grasps, readings, strict=True)]
    for finger in range(readings[0].shape[1]):
        least.append(_spread(np.concatenate([windows[held, finger] for windows, held in fast])) or 0.0)
        held = np.concatenate([windows[held, finger] for windows, held in slow])
        moving = np.concatenate([windows[:, finger] for windows, _ in slow])
        most.append(_spread(held[held != 0]) or _spread(moving[moving != 0]) or np.inf)
    rounding = find_step(np.concatenate([r.ravel() for r in readings])) / np.sqrt(12)
    return min(least) if min(least) > 2 * rounding else 0.0, max(*most, rounding)


def _stride(grasp: MeasuredGrasp) -> int:
    """Samples in the time after which slow noise is another."""
    return max(1, round(_SLOW_S / float(np.median(np.diff(grasp.time_s)))))


def _spread(windows: np.ndarray) -> float | None:
    """Noise that makes third differences like these, ``(n,)``; None if they are too few."""
    return float(white_noise(windows)) if len(windows) >= _LEAST_WINDOWS else None
