"""Where objects are and how wide, as far as contacts show: a start for fits of sets that do not say."""

from __future__ import annotations

import numpy as np

from forcegrasp.identify.phases import contacts
from forcegrasp.identify.problem import Problem
from forcegrasp.identify.target import Target
from forcegrasp.physics.gripper import Gripper


def guess(target: Target, problem: Problem) -> np.ndarray:
    """The problem's start, with radii and offsets read off where the fingers met the objects, ``(entries,)``.

    A fit can't find them by itself: as long as model and measurement touch at different times, no slope tells where.
    """
    radii, offsets = felt(target)
    vector = problem.start()
    for place, entry in enumerate(problem.entries):
        estimate = {"radius_m": radii, "offset_m": offsets}.get(entry.parameter)
        fitted_anywhere = entry.effect is None and not entry.precision
        if fitted_anywhere and estimate is not None and np.isfinite(estimate[entry.members]).any():
            vector[place] = entry.coordinate(float(np.nanmedian(estimate[entry.members])))
    return vector


def felt(target: Target) -> tuple[np.ndarray, np.ndarray]:
    """Radius and offset of each grasp's object where the fingers met it, metres, ``(G,)``; NaN where they did not."""
    radii, offsets = np.full((2, len(target.grasps)), np.nan)
    for index, grasp in enumerate(target.grasps):
        touching = contacts(grasp, target.sensor_sigma, target.gripper)
        if not touching.all(axis=1).any():
            continue
        both = int(np.argmax(touching.all(axis=1)))
        pads = pad_distances(target.gripper, grasp.position_m)
        radii[index] = pads[both].mean()
        first = int(np.argmax(touching.any(axis=1)))
        if touching[first].all():
            offsets[index] = (pads[first, 1] - pads[first, 0]) / 2
        else:  # the right finger stands on the positive side
            finger = int(np.argmax(touching[first]))
            offsets[index] = (pads[first, finger] - radii[index]) * (1 if finger else -1)
    return radii, offsets


def pad_distances(gripper: Gripper, position: np.ndarray) -> np.ndarray:
    """How far each side's pads stand from the middle of the scene's object, outward, metres, ``(T, 2)``.

    Args:
      gripper: whose pads they are.
      position: of the motors, m or rad, ``(T, motors)``.
    """
    if gripper.is_direct:
        return position
    law, mean = gripper.opening, position.mean(axis=1, keepdims=True)
    straight = np.array(law.faces_m) + law.travel * (mean - law.position[-1])
    return straight + (law.opening_at(mean) - straight.sum(axis=1, keepdims=True)) / 2  # hinges travel on arcs
