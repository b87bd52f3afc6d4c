"""Columns that are written to another row than the rest."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from forcegrasp.diagnosis.faults.fault import Fault, with_each
from forcegrasp.diagnosis.faults.late_side import command_row_later, late_side
from forcegrasp.diagnosis.faults.shifted_rows import WORTH_A_FIT, left_by_shift
from forcegrasp.diagnosis.signatures import Background
from forcegrasp.identify.fit import Fit
from forcegrasp.identify.intervals import listed
from forcegrasp.identify.loading import Loaded
from forcegrasp.identify.target import Target
from forcegrasp.measure.schema import MeasuredGrasp, MeasurementSet


def wrong_rows(loaded: Loaded[MeasurementSet], target: Target, fit: Fit) -> list[Fault]:
    """Columns that are written to another row than the rest."""
    measured, found = loaded.measured, []
    if early := _early_readings(target, fit):
        late = ", or commands stand one row late" if len(early) > 1 else ""
        words = f"{listed(early)} are what was read one row later{late}"
        check = "which row each column was written to, and its clock"
        found.append(Fault("early_row", words, check, with_each(loaded, lambda _, g: _one_row_later(g, early))))
    if (side := late_side(target, fit)) is not None:
        words = f"what {measured.columns.command[side]} commands is done one row later, and by the other motor at once"
        check = "which row each motor's command was written to, and whether both get theirs at once"

        def right_side(_: int, grasp: MeasuredGrasp) -> MeasuredGrasp:
            return dataclasses.replace(grasp, command_m=command_row_later(grasp.command_m, side))

        found.append(Fault("late_side", words, check, with_each(loaded, right_side)))
    return found


def _one_row_later(grasp: MeasuredGrasp, kinds: Sequence[str]) -> MeasuredGrasp:
    """The grasp less its first row, with readings of these kinds from the row before."""

    def moved(values: np.ndarray, kind: str) -> np.ndarray:
        return values[:-1] if kind in kinds else values[1:]

    return dataclasses.replace(
        grasp,
        time_s=grasp.time_s[1:],
        command_m=grasp.command_m[1:],
        position_m=moved(grasp.position_m, "positions"),
        force_n=moved(grasp.force_n, "forces"),
        object_m=None if grasp.object_m is None else grasp.object_m[1:],
        rows=None if grasp.rows is None else grasp.rows[1:],
    )


def _early_readings(target: Target, fit: Fit) -> tuple[str, ...]:
    """Which readings come before what makes them, and fit one row later; none if none do.

    No effect makes a reading early. Where positions and forces both are, the commands may be late.
    """
    background = Background(fit, ())
    least, best = (1 - WORTH_A_FIT) * max(0.0, left_by_shift(target, fit, background, [], later=True)), ()
    for kinds in (("position",), ("force",), ("position", "force")):
        parts = [target.axis.kinds.get(kind, slice(0, 0)) for kind in kinds]
        channels = [channel for part in parts for channel in range(part.start, part.stop)]
        left = left_by_shift(target, fit, background, channels, later=True)
        if left < least:
            least, best = left, tuple(f"{kind}s" for kind in kinds)
    return best
