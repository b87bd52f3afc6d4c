"""Where objects stood, from trials: the jolt of a pad that meets one is over before the next reading."""

from __future__ import annotations

import numpy as np

from forcegrasp.identify.fit import Fit
from forcegrasp.identify.predict import Case, predict
from forcegrasp.identify.simulators import cheap_tier
from forcegrasp.identify.target import Target
from forcegrasp.replay.replay import Replay

# Places that are tried, in standard deviations from where the set has them; then those nearer around the best of them.
_TRIALS = np.arange(-2.0, 2.1, 0.2)
_NEARER = np.arange(-0.15, 0.16, 0.05)
# A grasp whose squares are so many of their standard deviations more than noise has shows where its object stood.
_SHOWS = 2.0


def seen_places(target: Target, fit: Fit, members: np.ndarray, deviations: np.ndarray, std_m: float) -> np.ndarray:
    """Where places are to be moved to so that least is left of their grasps, in standard deviations, ``(k,)``.

    Slopes don't tell where a pad met the object: one or two readings have a part of the jolt, and which part depends
    on when they were taken. So what is left falls and rises with the place, more than once within its tolerance.

    Args:
      target: the measurements.
      fit: of them, with places as they are moved by now.
      members: the grasps, ``(k,)``.
      deviations: by how much their places are moved by now, in standard deviations, ``(k,)``.
      std_m: standard deviation of a place, metres.
    """
    found, squares = deviations.copy(), np.sum((fit.weight * fit.residual)[members] ** 2, axis=(1, 2))
    readings = target.mask[members].sum(axis=1) * target.signals.shape[-1]
    shows = np.flatnonzero(squares > readings + _SHOWS * np.sqrt(2 * readings))
    if not shows.size:
        return found
    part, of_part = fit.subset(members[shows]), target.subset(members[shows])
    problem, case = part.problem, part.problem.case(part.vector)
    replay = Replay(problem.gripper, problem.grasps, cheap_tier(problem.gripper))
    start, each = deviations[shows], np.arange(len(shows))

    def best_of(trials: np.ndarray) -> np.ndarray:
        offsets = case.base["offset_m"] + std_m * (trials - start)
        predicted = predict(replay, [Case(case.base | {"offset_m": offset}, case.effects) for offset in offsets])
        residuals = (of_part.residual(one + part.correction) for one in predicted)
        left = np.stack([np.sum((part.weight * residual) ** 2, axis=(1, 2)) for residual in residuals])
        return trials[(left + trials**2).argmin(axis=0), each]

    best = best_of(np.vstack([start, np.repeat(_TRIALS[:, None], len(shows), axis=1)]))
    found[shows] = best_of(best + _NEARER[:, None])
    return found
