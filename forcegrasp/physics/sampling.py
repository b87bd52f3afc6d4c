"""Draws grasps within the paper's constraints."""

from __future__ import annotations

import dataclasses

import numpy as np

from forcegrasp.config import GraspConfig, check_deformation
from forcegrasp.errors import ConfigError
from forcegrasp.physics.completion import complete
from forcegrasp.physics.gripper import Gripper
from forcegrasp.physics.gripper_file import default_gripper
from forcegrasp.physics.parameters import GraspParameters


def offset_limits_m(
    gripper: Gripper, radius_m: np.ndarray | float, deformation_m: float
) -> tuple[np.ndarray, np.ndarray]:
    """Where an object of this radius may stand along the grasp axis: lowest and highest o_y, metres, each ``(n,)``.

    Eq. 1 of the paper keeps the object inside the open gripper, \\|o_y\\| + r < q_max; eq. 2 lets both fingers reach
    it, r − d_p > \\|o_y\\|. Both are strict, hence the last bit taken off. A finger that stands still reaches nothing:
    the object has to be beside it, and the other finger brings it there.
    """
    radius, law = np.asarray(radius_m, float), gripper.opening
    left, right = law.faces_m
    moves = [finger.motor >= 0 for finger in gripper.fingers]
    by_left, by_right = (radius - deformation_m + beyond for beyond in law.reach_m)
    high = np.minimum(right - radius, by_left) if moves[0] else right - radius
    low = -np.minimum(left - radius, by_right) if moves[1] else radius - left
    return np.nextafter(low, np.inf), np.nextafter(high, -np.inf)


class GraspSampler:
    """Draws grasps from the ranges of a ``GraspConfig``; the ranges may be changed between draws.

    Args:
      config: the ranges; those left out are the gripper's.
      gripper: whose objects they are; the paper's by default.

    Raises:
      ConfigError: if the smallest object could be squeezed flat (paper, eq. 3: d_p < r), the largest does not fit in,
        or a servo gain is out of the description's bounds.
    """

    def __init__(self, config: GraspConfig, gripper: Gripper | None = None) -> None:
        self.gripper = gripper or default_gripper()
        self.config = complete(config, self.gripper)
        self._check_gain(self.config.b2)
        self.set_ranges(self.config.radius_m, self.config.offset_m)

    def _check_gain(self, b2: list[float]) -> None:
        gain = self.gripper.parameters.get(self.gripper.training.servo_gain)
        if gain and not gain.low <= b2[0] <= b2[1] <= gain.high:
            limits = f"[{gain.low:g}, {gain.high:g}] {gain.unit}"
            raise ConfigError(f"grasp.b2={b2}: must lie in {limits}, the bounds of {gain.name} of {self.gripper.name}")

    def set_ranges(self, radius_m: list[float], offset_m: list[float]) -> None:
        """Narrows or widens the object ranges, as the curriculum does."""
        check_deformation(self.config.deformation_m, radius_m, "radius_m")
        largest = float(self.gripper.opening.opening_m[-1]) / 2
        if radius_m[1] >= largest:
            name = self.gripper.name
            raise ConfigError(f"radius_m={radius_m}: {name} opens so wide that it takes radii below {largest:g} m")
        self.config = dataclasses.replace(self.config, radius_m=list(radius_m), offset_m=list(offset_m))

    def __call__(self, rng: np.random.Generator, ids: np.ndarray) -> GraspParameters:
        """Draws one grasp for each of ``ids`` (which only give the number)."""
        config, n, training = self.config, len(ids), self.gripper.training
        kappa = rng.uniform(*config.kappa, size=n)
        b2 = rng.uniform(*config.b2, size=n)
        radius = rng.uniform(*config.radius_m, size=n)
        lowest, highest = offset_limits_m(self.gripper, radius, config.deformation_m)
        bounds: list[np.ndarray] = [np.clip(bound, lowest, highest) for bound in config.offset_m]
        offset = rng.uniform(bounds[0], bounds[1])
        smallest = config.goal_force_min_n
        largest = config.goal_force_max * training.max_force_n * training.force_scale(kappa)
        goal = rng.uniform(np.minimum(smallest, largest), largest)
        return GraspParameters(kappa, b2, radius, offset, goal)


class FixedGrasps:
    """Stands in for a sampler where the grasps are given: grasp i of the batch is always ``parameters[i]``."""

    def __init__(self, parameters: GraspParameters) -> None:
        self.parameters = parameters

    def __call__(self, rng: np.random.Generator, ids: np.ndarray) -> GraspParameters:
        return self.parameters[ids]
