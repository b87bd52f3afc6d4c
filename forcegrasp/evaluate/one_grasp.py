"""One grasp as requested: what is not given is drawn such that the object can be grasped."""

from __future__ import annotations

import dataclasses

import numpy as np

from forcegrasp.config import GraspConfig, RenderConfig
from forcegrasp.errors import ConfigError
from forcegrasp.physics import GraspParameters, GraspSampler, Gripper, default_gripper
from forcegrasp.physics.completion import complete
from forcegrasp.physics.sampling import offset_limits_m


def draw_one_grasp(config: RenderConfig, gripper: Gripper | None = None) -> GraspParameters:
    """Draws what ``config`` leaves open from the default ranges, narrowed to what fits the given values.

    Raises:
      ConfigError: if what is given can't be grasped (paper, eqs. 1 and 2), or its goal can't be reached.
    """
    gripper = gripper or default_gripper()
    ranges = complete(GraspConfig(steps=config.steps), gripper)
    ranges = dataclasses.replace(
        ranges,
        kappa=_softness(config, ranges, gripper),
        radius_m=_radius(config, ranges, gripper),
        b2=ranges.b2 if config.b2 is None else [config.b2] * 2,
        offset_m=ranges.offset_m if config.offset_m is None else [config.offset_m] * 2,
    )
    drawn = GraspSampler(ranges, gripper)(np.random.default_rng(config.seed), np.arange(1))
    if config.goal_force_n is not None:
        drawn = dataclasses.replace(drawn, goal_force_n=np.array([config.goal_force_n]))
    return drawn


def _softness(config: RenderConfig, ranges: GraspConfig, gripper: Gripper) -> list[float]:
    """Softness values at which the gripper reaches the goal: f_goal ≤ goal_force_max · f_max · f_α(κ)."""
    low, high = ranges.kappa if config.kappa is None else [config.kappa] * 2
    if config.goal_force_n is None:
        return [low, high]

    def reach(kappa: float) -> float:
        return ranges.goal_force_max * gripper.training.max_force_n * float(gripper.training.force_scale(kappa))

    if config.goal_force_n > reach(low):
        raise ConfigError(
            f"goal_force_n={config.goal_force_n:g}: the gripper reaches {reach(low):.3g} N at softness kappa={low:g}"
        )
    hardest, softest = reach(0.0), reach(1.0)  # f_α falls linearly with κ, or stays
    if hardest == softest:
        return [low, high]
    return [low, min(high, (hardest - config.goal_force_n) / (hardest - softest))]


def _radius(config: RenderConfig, ranges: GraspConfig, gripper: Gripper) -> list[float]:
    """Radii that fit in at the given offset, and that every finger that moves reaches (paper, eqs. 1 and 2)."""
    low, high = ranges.radius_m if config.radius_m is None else [config.radius_m] * 2
    if config.offset_m is None:
        return [low, high]
    away, law = config.offset_m, gripper.opening
    left, right = law.faces_m
    moves = [finger.motor >= 0 for finger in gripper.fingers]
    if config.radius_m is not None:
        lowest, highest = (float(end) for end in offset_limits_m(gripper, config.radius_m, ranges.deformation_m))
        if not lowest <= away <= highest:
            raise ConfigError(
                f"offset_m={away:g}: an object of radius_m={config.radius_m:g} can be grasped"
                f" {_span('up to', lowest, highest)} m off the middle (paper, eqs. 1 and 2)"
            )
        return [low, high]
    sides = list(zip((1, -1), moves, law.reach_m, strict=True))
    smallest = [ranges.deformation_m + side * away - beyond for side, moving, beyond in sides if moving]
    fitting = [max(low, *smallest), min(high, right - away, left + away)]
    if fitting[0] >= fitting[1]:
        by_left, by_right = ((beyond - ranges.deformation_m) for beyond in law.reach_m)
        highest = (right + by_left) / 2 if moves[0] else right - low
        lowest = -(left + by_right) / 2 if moves[1] else low - left
        raise ConfigError(
            f"offset_m={away:g}: no object can be grasped {_span('beyond', lowest, highest)} m off the middle"
        )
    return fitting


def _span(word: str, lowest: float, highest: float) -> str:
    """Where offsets end, in words: alike on both sides, or not."""
    alike = np.isclose(-lowest, highest, atol=1e-9)
    return f"{word} ± {highest:.4f}" if alike else f"from {lowest:.4f} to {highest:.4f}"
