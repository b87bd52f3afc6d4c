"""Moments of inertia of an object whose radius differs from the scene's, at the same mass."""

from __future__ import annotations

import mujoco
import numpy as np

from forcegrasp.physics.gripper import Gripper


def inertia_of_radius(model: mujoco.MjModel, gripper: Gripper, radius_m: np.ndarray) -> np.ndarray:
    """Moments of inertia of an object that is all one geom, kg·m², ``(len(radius_m), 3)``."""
    geom = model.geom(gripper.object_geom)
    mass = model.body_mass[geom.bodyid[0]]
    # The order of operations is the compiler's: the last bit of an inertia can move a contact point.
    if geom.type[0] == mujoco.mjtGeom.mjGEOM_CYLINDER:
        length = 2 * geom.size[1]
        across = mass * (3 * radius_m * radius_m + length * length) / 12
        return np.stack([across, across, mass * radius_m * radius_m / 2], axis=1)
    if geom.type[0] == mujoco.mjtGeom.mjGEOM_SPHERE:
        return np.repeat((2 * mass * radius_m * radius_m / 5)[:, None], 3, axis=1)
    half = np.repeat(geom.size[None], len(radius_m), axis=0)
    half[:, gripper.axis] = radius_m
    squares = half**2
    return mass / 3 * (squares.sum(axis=1, keepdims=True) - squares)
