"""Draws grasps within the paper's constraints."""

from __future__ import annotations

import dataclasses

import numpy as np

from forcegrasp.config import GraspConfig, check_deformation
from forcegrasp.physics.parameters import MAX_FORCE_N, GraspParameters, force_scale_of_kappa

#: Finger position when fully open, q_max. Metres (paper, Sec. 3).
OPEN_M = 0.045


def offset_limit_m(radius_m: np.ndarray | float, deformation_m: float) -> np.ndarray:
    """Largest \\|o_y\\| that paper eqs. 1 and 2 allow an object of this radius. Metres, shape ``(n,)``.

    Eq. 1 keeps the object inside the open gripper, \\|o_y\\| + r < q_max; eq. 2 lets both fingers reach it,
    r − d_p > \\|o_y\\|. Both are strict, hence the last bit taken off.
    """
    return np.nextafter(np.minimum(OPEN_M - radius_m, radius_m - deformation_m), 0.0)


class GraspSampler:
    """Draws grasps from the ranges of a ``GraspConfig``; the ranges may be changed between draws.

    Raises:
      ConfigError: if the smallest object could be squeezed flat (paper, eq. 3: d_p < r).
    """

    def __init__(self, config: GraspConfig) -> None:
        self.config = config
        self.set_ranges(config.radius_m, config.offset_m)

    def set_ranges(self, radius_m: list[float], offset_m: list[float]) -> None:
        """Narrows or widens the object ranges, as the curriculum does."""
        check_deformation(self.config.deformation_m, radius_m, "radius_m")
        self.config = dataclasses.replace(self.config, radius_m=list(radius_m), offset_m=list(offset_m))

    def __call__(self, rng: np.random.Generator, ids: np.ndarray) -> GraspParameters:
        """Draws one grasp for each of ``ids`` (which only give the number)."""
        config, n = self.config, len(ids)
        kappa = rng.uniform(*config.kappa, size=n)
        b2 = rng.uniform(*config.b2, size=n)
        radius = rng.uniform(*config.radius_m, size=n)
        limit = offset_limit_m(radius, config.deformation_m)
        bounds: list[np.ndarray] = [np.clip(bound, -limit, limit) for bound in config.offset_m]
        offset = rng.uniform(bounds[0], bounds[1])
        lowest = config.goal_force_min_n
        highest = config.goal_force_max * MAX_FORCE_N * force_scale_of_kappa(kappa)
        goal = rng.uniform(np.minimum(lowest, highest), highest)
        return GraspParameters(kappa, b2, radius, offset, goal)


class FixedGrasps:
    """Stands in for a sampler where the grasps are given: grasp i of the batch is always ``parameters[i]``."""

    def __init__(self, parameters: GraspParameters) -> None:
        self.parameters = parameters

    def __call__(self, rng: np.random.Generator, ids: np.ndarray) -> GraspParameters:
        return self.parameters[ids]
