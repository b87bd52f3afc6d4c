"""Time stamps that scatter though readings were taken evenly: taken when a row was written, not when it was read."""

from __future__ import annotations

import dataclasses

import numpy as np

from forcegrasp.diagnosis.faults.shifted_rows import WORTH_A_FIT, left_beyond_noise
from forcegrasp.diagnosis.signatures import Background
from forcegrasp.identify.fit import Fit
from forcegrasp.identify.predict import predict
from forcegrasp.identify.simulators import cheap_tier
from forcegrasp.identify.target import Target
from forcegrasp.measure.schema import MeasuredGrasp
from forcegrasp.replay.replay import Replay

# Stamps that scatter by less than this share of their period are even.
_EVEN = 0.01


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
    """Whether readings fit much better what is simulated with even time stamps, where those of the set scatter.

    Args:
      target: the measurements.
      fit: of the base model.
    """
    period = np.median(np.concatenate([np.diff(g.time_s) for g in target.grasps]))
    if scatter_s(target) < _EVEN * period:
        return False
    gripper, case = fit.problem.gripper, fit.problem.case(fit.vector)
    said, even = (
        predict(Replay(gripper, grasps, cheap_tier(gripper)), [case])[0]
        for grasps in (target.grasps, [evenly(g) for g in target.grasps])
    )
    change = target.change(even, said)
    background = Background(fit, ())
    before, after = (left_beyond_noise(r, background, target) for r in (fit.residual, fit.residual - change))
    return after < (1 - WORTH_A_FIT) * before
