"""Checks that commands change, positions follow, and forces show contact with an object."""

from __future__ import annotations

import numpy as np

from forcegrasp.errors import MeasurementError
from forcegrasp.measure.samples import place, samples_file
from forcegrasp.measure.schema import MeasurementSet, side_of

#: Means of blocks of the force must vary this many times as much as noise would make them to be contact.
_CONTACT = 2.5
_BLOCKS = 10
# Rows at the start of a grasp, before anything is touched, that a zero is read from: seconds, and rows at least.
_FREE_S, LEAST_ROWS = 0.25, 5


def check_liveness(measured: MeasurementSet, reach: float) -> list[str]:
    """Raises MeasurementError if nothing was commanded, moved or touched in the whole set; returns warnings.

    Args:
      measured: the set.
      reach: how far a motor moves, m or rad.
    """
    where = samples_file(measured.path)
    grasps, columns = measured.grasps, measured.columns
    warnings = []
    if not any(np.ptp(grasp.command_m, axis=0).any() for grasp in grasps):
        if not _steps_only(measured, reach):
            raise MeasurementError(f"{where}: columns qdes_*: no command ever changes; record what was commanded")
        warnings.append(f"{where}: columns qdes_*: no command changes within a grasp; record some that do")
    for motor, column in enumerate(columns.position):
        moved = [np.ptp(grasp.position_m[:, motor]) for grasp in grasps]
        asked = [np.ptp(grasp.command_m[:, motor]) for grasp in grasps]
        if max(asked) > 0.1 * reach and max(moved) < 0.01 * reach:
            raise MeasurementError(
                f"{where}: column {column}: never moves, though commanded by {max(asked):g} {columns.unit};"
                " encoder stuck?"
            )
    return warnings + (_check_forces(measured, where) if columns.force else [])


def _check_forces(measured: MeasurementSet, where: str) -> list[str]:
    """Raises MeasurementError if a force channel is stuck, or none feels anything; returns warnings."""
    grasps, columns = measured.grasps, measured.columns.force
    for channel, column in enumerate(columns):
        force = np.concatenate([grasp.force_n[:, channel] for grasp in grasps])
        if force.any() and not np.ptp(force):
            which = f"{side_of(column)} sensor".strip()
            raise MeasurementError(f"{where}: column {column}: {force[0]:g} N in every sample; is the {which} stuck?")
    names, one = ", ".join(columns), len(columns) == 1
    named = f"{where}: column{'' if one else 's'} {names}"
    if not any(grasp.force_n.any() for grasp in grasps):
        raise MeasurementError(
            f"{named}: all forces are zero; {'is the sensor' if one else 'are the sensors'} connected?"
        )
    felt = np.array([feels(grasp.force_n) for grasp in grasps])
    if not felt.any() and len(grasps) > 1:  # a single grasp may well be too light to be felt
        raise MeasurementError(f"{named}: no contact in any grasp; record grasps of an object")
    warnings = [
        f"{where}: column {column}: the {f'{side_of(column)} finger'.strip()} feels nothing in any grasp"
        for channel, column in enumerate(columns)
        if not felt[:, channel].any()
    ]
    unseen = "forces show no contact, for they do no more than drift and jitter"
    if measured.columns.read_effort:
        unseen = "no contact, which an effort shows only while the motor stands"
    return warnings + [
        f"{place(measured.path, grasp)}: {unseen}"
        for grasp, some in zip(grasps, np.any(felt, axis=1), strict=True)
        if not some
    ]


def _steps_only(measured: MeasurementSet, reach: float) -> bool:
    """Whether the motors go to commands that were given before the first sample, in most grasps."""
    gaps = [np.abs(g.position_m[[0, -1]] - g.command_m[[0, -1]]).max(axis=1) for g in measured.grasps]
    return float(np.mean([start > 0.05 * reach and end < 0.7 * start for start, end in gaps])) > 0.5


def force_noise(force: np.ndarray, std: float | None = None) -> float:
    """Noise of one force signal ``(T,)``: as given, as it jitters, or as it is resolved, whichever is largest."""
    jitter = float(np.median(np.abs(np.diff(force, 2)))) / 1.65  # what it is for white noise, and 0 for a ramp
    steps = np.abs(np.diff(force))
    quantised = np.sum(steps > 0) >= 5 and np.mean(steps == 0) > 0.2  # many equal neighbours
    resolution = float(steps[steps > 0].min()) / np.sqrt(12) if quantised else 0.0
    return max(std or 0.0, jitter, resolution)


def zero_force(time: np.ndarray, force: np.ndarray) -> np.ndarray:
    """What force channels ``(T, channels)`` read at the start of a grasp, ``(channels,)``."""
    rows = max(LEAST_ROWS, int(np.searchsorted(time, time[0] + _FREE_S)))
    return np.median(force[:rows], axis=0)


def without_trend(values: np.ndarray, time: np.ndarray) -> np.ndarray:
    """The values ``(T,)`` less their least-squares line over time."""
    basis = np.stack([np.ones_like(time), time - time.mean()], axis=1)
    return values - basis @ np.linalg.lstsq(basis, values, rcond=None)[0]


def feels(force: np.ndarray) -> list[bool]:
    """Per channel, whether the force ``(T, channels)`` does more than drift and jitter, whatever noise is given.

    Noise vanishes in the means of blocks, so that these show a light touch.
    """
    blocks = [block.mean(axis=0) for block in np.array_split(force, _BLOCKS)]
    index = np.arange(_BLOCKS, dtype=float)
    expected = [force_noise(f) / np.sqrt(len(force) / _BLOCKS) for f in force.T]
    rest = [np.std(without_trend(means, index)) for means in np.transpose(blocks)]
    return [bool(r > _CONTACT * e) for r, e in zip(rest, expected, strict=True)]
