"""Can a set of a servo be right? Refuses what no physical effect explains."""

from __future__ import annotations

import numpy as np

from forcegrasp.errors import MeasurementError
from forcegrasp.measure.samples import place
from forcegrasp.measure.schema import MeasuredGrasp, MeasurementSet

# No joint of a servo is said to turn further, radians; no slide to go further, metres.
_FAR = {"rad": 100.0, "m": 20.0}


def check_servo(measured: MeasurementSet) -> list[str]:
    """Checks the recordings of a set; returns warnings, one line each.

    Raises:
      MeasurementError: where, why, and what to do.
    """
    for one in measured.grasps:
        _check_units(measured, one)
        _check_relation(measured, one)
    return list(measured.notes)


def _check_units(measured: MeasurementSet, one: MeasuredGrasp) -> None:
    unit, columns = one.columns.unit, one.columns
    for name, values in zip(columns.position, one.position_m.T, strict=True):
        where = place(measured.path, one, None, name)
        if np.ptp(values) == 0:
            raise MeasurementError(f"{where}: never changes; is it the right column, and was the encoder read?")
        if np.abs(values).max() > _FAR[unit]:
            units = "counts or degrees" if unit == "rad" else "millimetres or counts"
            raise MeasurementError(f"{where}: up to {np.abs(values).max():g} {unit}: looks like {units}; say the unit")
    for name, values in zip(columns.command, one.command_m.T, strict=True):
        if np.ptp(values) == 0 and one.enabled is None:
            raise MeasurementError(f"{place(measured.path, one, None, name)}: never changes; is it the right column?")


def _check_relation(measured: MeasurementSet, one: MeasuredGrasp) -> None:
    """Refuses commands that are positions, as they are or a row apart, and commands in another unit."""
    if not one.columns.command[0].startswith("qdes"):
        return
    command, position = one.command_m[:, 0], one.position_m[:, 0]
    where = place(measured.path, one, None, one.columns.command[0])
    for shift in (0, 1, -1):
        shifted = np.roll(position, shift)[2:-2]
        if np.array_equal(command[2:-2], shifted):
            raise MeasurementError(
                f"{where}: is the position itself, {shift} rows apart; name the command's own column"
            )
    slope = np.polyfit(command, position, 1)[0] if np.ptp(command) > 0 else 1.0
    if abs(np.corrcoef(command, position)[0, 1] if np.ptp(command) > 0 else 0.0) < 0.9:
        return
    for factor, what in (
        (180 / np.pi, "degrees"),
        (np.pi / 180, "radians where the position has degrees"),
        (-1, "turned round"),
    ):
        if abs(slope * factor - 1) < 0.15:
            raise MeasurementError(
                f"{where}: follows the position with a factor of {1 / slope:.3g}: looks {what}; say its unit or sign"
            )
