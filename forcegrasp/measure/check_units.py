"""Metres, seconds, newtons? A gripper's own range tells, and the time between samples."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from forcegrasp.errors import MeasurementError
from forcegrasp.measure.folder import show
from forcegrasp.measure.samples import place
from forcegrasp.measure.schema import OBJECT, MeasuredGrasp, MeasurementSet

#: Beyond this many times the gripper's range, a length is in another unit.
_OTHER_UNIT = 10
#: Beyond this, an object is heavier than any that a gripper holds.
_HEAVY_KG = 50.0
#: How the lengths and angles of other units are told, by the unit that they should have.
_MISTAKEN = {"m": "looks like millimetres, divide by 1000", "rad": "looks like degrees, multiply by π/180"}
_REACHES = {
    "m": "finger that goes from {:g} to {:g} m; give metres per finger, of the right gripper",
    "rad": "motor that goes from {:g} to {:g} rad; give radians of the motor, of the right gripper",
}
#: Beyond this many times the range, a finger is where the gripper can't be.
_OUT_OF_REACH = 1.5
#: Beyond this, a force is none of a gripper's.
_LARGEST_N = 1e5
_CLOCKS = ((1e6, "nanoseconds", "1e9"), (1e3, "microseconds", "1e6"), (1, "milliseconds", "1000"))


def check_units(measured: MeasurementSet, open_m: float, closed_m: float, half_opening_m: float) -> list[str]:
    """Raises MeasurementError about lengths, angles or times in another unit; returns warnings about odd ones."""
    reach = abs(open_m - closed_m)
    _check_position_noise(measured, reach)
    warnings = []
    for grasp in measured.grasps:
        _check_object(measured, grasp, half_opening_m)
        _check_positions(measured, grasp, open_m, closed_m)
        _check_clock(measured, grasp)
        for name, force in zip(grasp.columns.force, grasp.force_n.T, strict=True):
            check_forces(force, lambda index, grasp=grasp, name=name: place(measured.path, grasp, index, name))
        warnings += _warnings(measured, grasp, half_opening_m)
    if measured.columns.force:
        forces = np.concatenate([g.force_n.ravel() for g in measured.grasps])
        check_force_noise(measured.path, measured.force_std_n, forces)
    return warnings


def check_forces(force: np.ndarray, where: Callable[[int], str]) -> None:
    """Raises MeasurementError about the first force ``(n,)`` that no gripper has; ``where`` places it by its index."""
    absurd = np.abs(force) > _LARGEST_N
    if absurd.any():
        index = int(absurd.argmax())
        raise MeasurementError(f"{where(index)}: {force[index]:g} is no force of a gripper; give newtons")


def check_force_noise(path: Path, std: float | None, force: np.ndarray) -> None:
    """Raises MeasurementError if the noise that is given is larger than all that the forces ``(n,)`` do."""
    spread = float(np.ptp(force))
    if spread and (std or 0) > spread:
        raise MeasurementError(
            f"{show(path / 'meta.yaml')}: force_std_n: {std:g} is more than the {spread:.3g} N from the smallest to the"
            " largest force: looks like millinewtons, divide by 1000"
        )


def _check_position_noise(measured: MeasurementSet, reach: float) -> None:
    unit = measured.columns.unit
    if (measured.position_std_m or 0) > 0.1 * reach:
        raise MeasurementError(
            f"{show(measured.path / 'meta.yaml')}: position_std_m: {measured.position_std_m:g} is more than a tenth of"
            f" the {reach:g} {unit} that the gripper opens: {_MISTAKEN[unit]}"
        )


def _check_object(measured: MeasurementSet, grasp: MeasuredGrasp, half_opening_m: float) -> None:
    """Raises MeasurementError about an object's size or place that is not in metres."""
    for name, value in (("object_radius_m", grasp.radius_m), ("object_offset_m", grasp.offset_m)):
        if value is not None and abs(value) > _OTHER_UNIT * half_opening_m:
            raise MeasurementError(
                f"{show(measured.path / 'grasps.csv')}: grasp {show(grasp.name)}, column {name}: {value:g} where the"
                f" gripper opens {half_opening_m:g} m: {_MISTAKEN['m']}"
            )
    if (grasp.mass_kg or 0) > _HEAVY_KG:
        raise MeasurementError(
            f"{show(measured.path / 'grasps.csv')}: grasp {show(grasp.name)}, column object_mass_kg: {grasp.mass_kg:g}"
            " is more than a gripper holds: looks like grams, divide by 1000"
        )
    if grasp.object_m is not None:
        _check_size(measured, grasp, OBJECT, half_opening_m, _OTHER_UNIT * half_opening_m, "m")


def _check_positions(measured: MeasurementSet, grasp: MeasuredGrasp, open_m: float, closed_m: float) -> None:
    """Raises MeasurementError about commands or positions in another unit, or out of the gripper's reach."""
    reach, signals, columns = abs(open_m - closed_m), grasp.signals(), grasp.columns
    for column in (*columns.command, *columns.position):
        most = _OTHER_UNIT * max(reach, abs(open_m), abs(closed_m))
        _check_size(measured, grasp, column, reach, most, columns.unit)
    for column in columns.position:
        outside = np.abs(signals[column] - (open_m + closed_m) / 2) > (_OUT_OF_REACH - 0.5) * reach
        if outside.any():
            index = int(outside.argmax())
            raise MeasurementError(
                f"{place(measured.path, grasp, index, column)}: {signals[column][index]:g} is out of reach of a"
                f" {_REACHES[columns.unit].format(closed_m, open_m)}"
            )


def _check_size(
    measured: MeasurementSet, grasp: MeasuredGrasp, column: str, reach: float, most: float, unit: str
) -> None:
    values = grasp.signals()[column]
    far = int(np.abs(values).argmax())
    if abs(values[far]) > most:
        raise MeasurementError(
            f"{place(measured.path, grasp, far, column)}: {values[far]:g} where the gripper opens {reach:g} {unit}:"
            f" {_MISTAKEN[unit]}"
        )


def _check_clock(measured: MeasurementSet, grasp: MeasuredGrasp) -> None:
    interval = float(np.median(np.diff(grasp.time_s)))
    for at_least, unit, factor in _CLOCKS:
        if interval > at_least:
            raise MeasurementError(
                f"{place(measured.path, grasp, 1, 't_s')}: samples are {interval:g} s apart: looks like {unit},"
                f" divide by {factor}"
            )


def _warnings(measured: MeasurementSet, grasp: MeasuredGrasp, half_opening_m: float) -> list[str]:
    warnings = []
    where = place(measured.path, grasp)
    if grasp.radius_m is not None and grasp.radius_m > 1.2 * half_opening_m:
        warnings.append(
            f"{where}: a radius of {grasp.radius_m:g} m does not fit between fingers that open {half_opening_m:g} m"
        )
    if np.median(np.diff(grasp.time_s)) < 1e-5:
        warnings.append(f"{where}: more than 100,000 samples per second; is t_s in seconds?")
    largest = np.abs(grasp.force_n).max(initial=0.0)
    if largest > 1000:
        warnings.append(f"{where}: forces of {largest:.4g} N; are they in newtons?")
    return warnings
