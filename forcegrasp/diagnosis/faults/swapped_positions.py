"""Whether the columns of two motors' positions stand for one another, where both are commanded alike."""

from __future__ import annotations

import dataclasses

from forcegrasp.diagnosis.faults.shifted_rows import WORTH_A_FIT
from forcegrasp.identify.fit import Fit
from forcegrasp.identify.target import Target
from forcegrasp.measure.schema import MeasuredGrasp


def positions_are_swapped(target: Target, fit: Fit) -> bool:
    """Whether the positions of two motors, exchanged, leave most of what a fit misses them by out.

    A fit does not follow them: where an object stands off centre, forces and places say which finger met it first.
    """
    positions = target.axis.positions
    if positions.stop - positions.start != 2:
        return False
    exchanged = with_columns_exchanged(target, positions).residual(fit.predicted)
    return target.beyond_noise(exchanged) < (1 - WORTH_A_FIT) * target.beyond_noise(fit.residual)


def with_columns_exchanged(target: Target, columns: slice) -> Target:
    """The measurements with the left and the right one of two channels, such as both positions, exchanged."""
    signals = target.signals.copy()
    signals[..., columns] = target.signals[..., columns][..., ::-1]
    return dataclasses.replace(target, signals=signals)


def with_positions_swapped(grasp: MeasuredGrasp) -> MeasuredGrasp:
    """The grasp with each motor's positions in the other one's place."""
    return dataclasses.replace(grasp, position_m=grasp.position_m[:, ::-1].copy())
