"""Did anything happen? Commands that change, positions that follow, forces that feel an object."""

from __future__ import annotations

import numpy as np

from forcegrasp.errors import MeasurementError
from forcegrasp.measure.samples import place, samples_file
from forcegrasp.measure.schema import FINGERS, FORCE, POSITION, MeasurementSet

#: Means of blocks of the force must vary this many times as much as noise would make them to be contact.
_CONTACT = 2.5
_BLOCKS = 10


def check_liveness(measured: MeasurementSet, reach: float) -> list[str]:
    """Raises MeasurementError if nothing was commanded, moved or touched in the whole set; returns warnings.

    Args:
      measured: the set.
      reach: how far a finger moves, metres.
    """
    where = samples_file(measured.path)
    grasps = measured.grasps
    warnings = []
    if not any(np.ptp(grasp.command_m, axis=0).any() for grasp in grasps):
        if not _steps_only(measured, reach):
            raise MeasurementError(f"{where}: columns qdes_*: no command ever changes; record what was commanded")
        warnings.append(f"{where}: columns qdes_*: no command changes within a grasp; record some that do")
    for finger, name in enumerate(FINGERS):
        moved = [np.ptp(grasp.position_m[:, finger]) for grasp in grasps]
        asked = [np.ptp(grasp.command_m[:, finger]) for grasp in grasps]
        if max(asked) > 0.1 * reach and max(moved) < 0.01 * reach:
            raise MeasurementError(
                f"{where}: column {POSITION[finger]}: never moves, though commanded by {max(asked):g} m; encoder stuck?"
            )
        force = np.concatenate([grasp.force_n[:, finger] for grasp in grasps])
        if force.any() and not np.ptp(force):
            raise MeasurementError(
                f"{where}: column {FORCE[finger]}: {force[0]:g} N in every sample; is the {name} sensor stuck?"
            )
    if not any(grasp.force_n.any() for grasp in grasps):
        raise MeasurementError(f"{where}: columns f_l_n, f_r_n: all forces are zero; are the sensors connected?")
    felt = np.array([feels(grasp.force_n) for grasp in grasps])
    if not felt.any() and len(grasps) > 1:  # a single grasp may well be too light to be felt
        raise MeasurementError(f"{where}: columns f_l_n, f_r_n: no contact in any grasp; record grasps of an object")
    warnings += [
        f"{where}: column {FORCE[finger]}: the {name} finger feels nothing in any grasp"
        for finger, name in enumerate(FINGERS)
        if not felt[:, finger].any()
    ]
    return warnings + [
        f"{place(measured.path, grasp)}: no contact"
        for grasp, some in zip(grasps, np.any(felt, axis=1), strict=True)
        if not some
    ]


def _steps_only(measured: MeasurementSet, reach: float) -> bool:
    """Whether the fingers go to commands that were given before the first sample, in most grasps."""
    gaps = [np.abs(g.position_m[[0, -1]] - g.command_m[[0, -1]]).max(axis=1) for g in measured.grasps]
    return float(np.mean([start > 0.05 * reach and end < 0.7 * start for start, end in gaps])) > 0.5


def force_noise(force: np.ndarray, std: float | None = None) -> float:
    """Noise of one force signal ``(T,)``: as given, as it jitters, or as it is resolved, whichever is largest."""
    jitter = float(np.median(np.abs(np.diff(force, 2)))) / 1.65  # what it is for white noise, and 0 for a ramp
    steps = np.abs(np.diff(force))
    quantised = np.sum(steps > 0) >= 5 and np.mean(steps == 0) > 0.2  # many equal neighbours
    resolution = float(steps[steps > 0].min()) / np.sqrt(12) if quantised else 0.0
    return max(std or 0.0, jitter, resolution)


def without_trend(values: np.ndarray, time: np.ndarray) -> np.ndarray:
    """The values ``(T,)`` less their least-squares line over time."""
    basis = np.stack([np.ones_like(time), time - time.mean()], axis=1)
    return values - basis @ np.linalg.lstsq(basis, values, rcond=None)[0]


def feels(force: np.ndarray) -> list[bool]:
    """Per finger, whether the force ``(T, 2)`` does more than drift and jitter, whatever its noise is said to be.

    Noise vanishes in the means of blocks, so that these show a light touch.
    """
    blocks = [block.mean(axis=0) for block in np.array_split(force, _BLOCKS)]
    index = np.arange(_BLOCKS, dtype=float)
    expected = [force_noise(f) / np.sqrt(len(force) / _BLOCKS) for f in force.T]
    rest = [np.std(without_trend(means, index)) for means in np.transpose(blocks)]
    return [bool(r > _CONTACT * e) for r, e in zip(rest, expected, strict=True)]
