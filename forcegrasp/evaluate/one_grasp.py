"""One grasp as it was asked for: what is not given is drawn, so that the whole can be grasped."""

from __future__ import annotations

import dataclasses

import numpy as np

from forcegrasp.config import GraspConfig, RenderConfig
from forcegrasp.errors import ConfigError
from forcegrasp.physics import GraspParameters, GraspSampler
from forcegrasp.physics.parameters import MAX_FORCE_N, force_scale_of_kappa
from forcegrasp.physics.sampling import OPEN_M, offset_limit_m


def draw_one_grasp(config: RenderConfig) -> GraspParameters:
    """Draws what ``config`` leaves open from the default ranges, narrowed to what goes with that which is given.

    Raises:
      ConfigError: if what is given can't be grasped (paper, eqs. 1 and 2), or its goal can't be reached.
    """
    ranges = GraspConfig(steps=config.steps)
    ranges = dataclasses.replace(
        ranges,
        kappa=_softness(config, ranges),
        radius_m=_radius(config, ranges),
        b2=ranges.b2 if config.b2 is None else [config.b2] * 2,
        offset_m=ranges.offset_m if config.offset_m is None else [config.offset_m] * 2,
    )
    drawn = GraspSampler(ranges)(np.random.default_rng(config.seed), np.arange(1))
    if config.goal_force_n is not None:
        drawn = dataclasses.replace(drawn, goal_force_n=np.array([config.goal_force_n]))
    return drawn


def _softness(config: RenderConfig, ranges: GraspConfig) -> list[float]:
    """Softness values at which the gripper reaches the goal: f_goal ≤ goal_force_max · 0.30 N · f_α(κ)."""
    low, high = ranges.kappa if config.kappa is None else [config.kappa] * 2
    if config.goal_force_n is None:
        return [low, high]

    def reach(kappa: float) -> float:
        return ranges.goal_force_max * MAX_FORCE_N * float(force_scale_of_kappa(np.float64(kappa)))

    if config.goal_force_n > reach(low):
        raise ConfigError(
            f"goal_force_n={config.goal_force_n:g}: the gripper reaches {reach(low):.3g} N at softness kappa={low:g}"
        )
    hardest, softest = reach(0.0), reach(1.0)  # f_α falls linearly with κ
    return [low, min(high, (hardest - config.goal_force_n) / (hardest - softest))]


def _radius(config: RenderConfig, ranges: GraspConfig) -> list[float]:
    """Radii that both fingers reach at the given offset, \\|o_y\\| ≤ min(q_max − r, r − d_p)."""
    low, high = ranges.radius_m if config.radius_m is None else [config.radius_m] * 2
    if config.offset_m is None:
        return [low, high]
    away = abs(config.offset_m)
    fitting = [max(low, ranges.deformation_m + away), min(high, OPEN_M - away)]
    if config.radius_m is not None:
        limit = float(offset_limit_m(np.float64(config.radius_m), ranges.deformation_m))
        if away > limit:
            raise ConfigError(
                f"offset_m={config.offset_m:g}: an object of radius_m={config.radius_m:g} can be grasped"
                f" up to ± {limit:.4f} m off the middle (paper, eqs. 1 and 2)"
            )
        return [low, high]
    if fitting[0] >= fitting[1]:
        best = (OPEN_M - ranges.deformation_m) / 2
        raise ConfigError(
            f"offset_m={config.offset_m:g}: no object can be grasped beyond ± {best:.4f} m off the middle"
        )
    return fitting
