"""Time stamps that scatter though readings were taken evenly: taken when a row was written, not when it was read."""

from __future__ import annotations

import dataclasses

import numpy as np

from forcegrasp.identify.fit import Fit
from forcegrasp.identify.predict import predict
from forcegrasp.identify.simulators import cheap_tier
from forcegrasp.identify.target import Target
from forcegrasp.measure.schema import MeasuredGrasp
from forcegrasp.replay.replay import Replay

# Stamps that scatter by less than this share of their period are even.
_EVEN = 0.01
# Readings that follow more than half of a change are nearer to it than to none; so many standard errors make it sure.
_NEARER, _SURELY = 0.5, 3.0
# What is so many times the noise says as much as what is less.
_LARGE = 3.0


def evenly(grasp: MeasuredGrasp) -> MeasuredGrasp:
    """A grasp with its time stamps on the straight line through them; rows that are missing stay so."""
    time = grasp.time_s
    apart = np.diff(time)
    row = np.r_[0, np.maximum(np.rint(apart / np.median(apart)), 1).cumsum()]
    period, first = np.polyfit(row, time, 1)
    return dataclasses.replace(grasp, time_s=first + period * row)


def scatter_s(target: Target) -> float:
    """Standard deviation of the time stamps around even ones, seconds."""
    return float(np.std(np.concatenate([g.time_s - evenly(g).time_s for g in target.grasps])))


def are_even_in_truth(target: Target, fit: Fit) -> bool:
    """Whether readings are surely nearer to what is simulated with even time stamps, where those of the set scatter.

    What even stamps change goes up and down from row to row as nothing else does: whatever else the model lacks, the
    readings follow it by all of it, on average, if they were taken evenly, and by nothing if the stamps are right.

    Args:
      target: the measurements.
      fit: of a model.
    """
    period = np.median(np.concatenate([np.diff(g.time_s) for g in target.grasps]))
    if scatter_s(target) < _EVEN * period:
        return False
    gripper, case = fit.problem.gripper, fit.problem.case(fit.vector)
    said, even = (
        predict(Replay(gripper, grasps, cheap_tier(gripper)), [case])[0]
        for grasps in (target.grasps, [evenly(g) for g in target.grasps])
    )
    residual, change = _from_row_to_row(fit.residual), _from_row_to_row(target.change(even, said))
    # jolts, of which a little time makes much, say little; how far a reading itself is off must not weigh it
    weight = 1 / (1 + (_of_neighbours(residual) ** 2 + change**2) / _LARGE**2)
    followed, whole = (np.sum(weight * change * one, axis=(1, 2)) for one in (residual, change))
    share = followed.sum() / max(whole.sum(), 1e-9)
    error = np.sqrt(np.sum((followed - share * whole) ** 2)) / max(whole.sum(), 1e-9)
    return bool(share - _SURELY * error > _NEARER)


def _from_row_to_row(signals: np.ndarray) -> np.ndarray:
    """What each row of ``(G, S, C)`` differs by from the mean of the two beside it, ``(G, S − 2, C)``."""
    return signals[:, 1:-1] - (signals[:, :-2] + signals[:, 2:]) / 2


def _of_neighbours(signals: np.ndarray) -> np.ndarray:
    """The mean size of the two beside each row, in the same shape."""
    sizes = np.pad(np.abs(signals), ((0, 0), (1, 1), (0, 0)))
    return (sizes[:, :-2] + sizes[:, 2:]) / 2
