"""Grasps in which the columns of both fingers' forces stand for one another, though not in the others."""

from __future__ import annotations

import dataclasses

import numpy as np

from forcegrasp.diagnosis.faults.swapped_positions import with_columns_exchanged
from forcegrasp.identify.fit import Fit
from forcegrasp.identify.target import Target
from forcegrasp.measure.schema import MeasuredGrasp

# A grasp tells which way round its forces are if the other way leaves so many times as much of them, in squares.
_TELLS = 2.0
# So few are rather misplaced objects.
_FEWEST = 2


def grasps_with_swapped_forces(target: Target, fit: Fit) -> tuple[int, ...]:
    """Indices of grasps whose forces a fit misses by far less with their two columns exchanged.

    None if all that tell are: that is the effect ``swapped_forces``. Grasps of a centred object do not tell.
    """
    forces = target.axis.forces
    if forces.stop - forces.start != 2:
        return ()
    both_ways = target, with_columns_exchanged(target, forces)
    left, left_so = (one.residual(fit.predicted) for one in both_ways)
    felt, felt_so = (np.sum(one[..., forces] ** 2, axis=(1, 2)) for one in (left, left_so))
    swapped = np.flatnonzero(felt > _TELLS * felt_so)
    return tuple(swapped.tolist()) if len(swapped) >= _FEWEST and np.any(felt_so > _TELLS * felt) else ()


def with_forces_swapped(grasp: MeasuredGrasp) -> MeasuredGrasp:
    """The grasp with each finger's forces in the other one's place."""
    return dataclasses.replace(grasp, force_n=grasp.force_n[:, ::-1].copy())
