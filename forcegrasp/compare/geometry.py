"""Where objects are and how wide, as far as the fingers felt it: a start for fits of sets that do not say."""

from __future__ import annotations

import numpy as np

from forcegrasp.compare.problem import Problem
from forcegrasp.compare.target import Target, contacts


def guess(target: Target, problem: Problem) -> np.ndarray:
    """The problem's start, with radii and offsets read off where the fingers met the objects, ``(entries,)``.

    A fit can't find them by itself: as long as model and measurement touch at different times, no slope tells where.
    """
    radii, offsets = np.full((2, len(target.grasps)), np.nan)
    for index, grasp in enumerate(target.grasps):
        touching = contacts(grasp, target.sensor_sigma[2:])
        if not touching.all(axis=1).any():
            continue
        both = int(np.argmax(touching.all(axis=1)))
        radii[index] = grasp.position_m[both].mean()
        first = int(np.argmax(touching.any(axis=1)))
        if touching[first].all():
            offsets[index] = (grasp.position_m[first, 1] - grasp.position_m[first, 0]) / 2
        else:  # the right finger stands on the positive side
            finger = int(np.argmax(touching[first]))
            offsets[index] = (grasp.position_m[first, finger] - radii[index]) * (1 if finger else -1)
    vector = problem.start()
    for place, entry in enumerate(problem.entries):
        felt = {"radius_m": radii, "offset_m": offsets}.get(entry.parameter)
        if entry.effect < 0 and felt is not None and np.isfinite(felt[entry.members]).any():
            vector[place] = entry.coordinate(float(np.nanmedian(felt[entry.members])))
    return vector
