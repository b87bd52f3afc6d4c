"""By how much rows are read earlier or later than their time stamps say."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from forcegrasp.diagnosis.verdict import LEAST_SHARE
from forcegrasp.identify.fit import Fit
from forcegrasp.identify.predict import predict
from forcegrasp.identify.simulators import cheap_tier
from forcegrasp.identify.target import Target
from forcegrasp.physics.gripper import FORCE_SKEW, SKEW
from forcegrasp.replay.replay import Replay

# How much later and earlier all is read for slopes, seconds; and how many standard errors make it sure.
_LATER_S, _SURELY = 1e-3, 4.0


@dataclass(frozen=True)
class ClockJitter:
    """Scatter of the instants at which rows are read around their time stamps."""

    std_s: float  #: standard deviation, seconds
    share: float  #: of the mean square that positions leave beyond their noise


def clock_jitter(residual: np.ndarray, target: Target, fit: Fit) -> ClockJitter | None:
    """The scatter, if it is beyond doubt and makes much of what positions leave; None of a single position.

    A row that is read late shows every finger farther on, and the row after it nothing of that. So the residuals of
    two positions go together within a row, by the product of their speeds, and not from one row to the next. The noise
    of two sensors does not, what both share does so at any speed, and what a model lacks goes on from row to row.

    Args:
      residual: of held-out grasps, in units of the noise, ``(G, S, C)``.
      target: the measurements.
      fit: of a model that leaves little but noise: one that lacks much foretells no single row.
    """
    positions = range(target.axis.positions.start, target.axis.positions.stop)
    pairs = [(one, other) for one in positions for other in positions if one < other]
    if not pairs:
        return None
    left = np.where(target.mask[..., None], residual, np.nan)
    speeds = _speeds(target, fit)
    together, wanted = (np.zeros(len(target.grasps)) for _ in range(2))
    for one, other in pairs:
        product = (speeds[..., one] * speeds[..., other])[:, 1:-1]
        # a row that moves by many times the noise counts no more than one that moves by the noise
        weight = 1 / ((1 + speeds[..., one] ** 2) * (1 + speeds[..., other] ** 2))[:, 1:-1]
        same = (left[..., one] * left[..., other])[:, 1:-1]
        alone = np.where(np.isfinite(same), same - _of_next_rows(left[..., one], left[..., other]), np.nan)
        weight = np.where(np.isfinite(alone), weight, 0.0)
        beyond_usual = product - np.sum(weight * product) / max(np.sum(weight), 1e-9)  # slow rows have it, too
        together += np.nansum(weight * beyond_usual * alone, axis=1)
        wanted += np.sum(weight * beyond_usual**2, axis=1)
    if not wanted.any():
        return None
    square = together.sum() / wanted.sum()  # of the scatter, in units of the shift
    error = np.sqrt(np.sum((together - wanted * square) ** 2)) / wanted.sum()
    moves = [square * np.mean(speeds[..., k][target.mask] ** 2) for k in positions]
    beyond = np.nanmean(left[..., target.axis.positions] ** 2) - 1
    share = float(np.mean(moves) / max(beyond, 1e-9))
    if square <= _SURELY * error or share <= LEAST_SHARE:
        return None
    return ClockJitter(_LATER_S * float(np.sqrt(square)), min(share, 1.0))


def _speeds(target: Target, fit: Fit) -> np.ndarray:
    """What signals ÷ noise change by within :data:`_LATER_S`, ``(G, S, C)``."""
    gripper, case = fit.problem.gripper, fit.problem.case(fit.vector)
    read = [case.moved({SKEW: by, FORCE_SKEW: by}) for by in (_LATER_S, -_LATER_S)]
    later, earlier = predict(Replay(gripper, fit.problem.grasps, cheap_tier(gripper)), read)
    return target.change(later, earlier) / 2


def _of_next_rows(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Mean product of two signals ``(G, S)`` a row apart, around each row but the first and last, ``(G, S - 2)``."""
    return (one[:, 1:-1] * (other[:, 2:] + other[:, :-2]) + other[:, 1:-1] * (one[:, 2:] + one[:, :-2])) / 4
