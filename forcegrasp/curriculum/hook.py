"""Applies the curriculum to an environment between batches."""

from __future__ import annotations

from typing import Any

from torchrl.envs import EnvBase

from forcegrasp.curriculum.schedule import CurriculumValues, LinearSchedule


class CurriculumHook:
    """Sets the environment to the schedule's values; new ranges hold from the next reset on.

    Args:
      schedule: frames → values.
      env: a (transformed) :class:`~forcegrasp.env.GraspEnv` that draws its grasps.
    """

    def __init__(self, schedule: LinearSchedule, env: EnvBase) -> None:
        self.schedule = schedule
        self._grasps: Any = getattr(env, "base_env", env)

    def apply(self, frames: int) -> CurriculumValues:
        """Applies and returns the values that hold after ``frames`` frames."""
        values = self.schedule(frames)
        self._grasps.reward_config.object_weight = values.object_weight
        self._grasps.reward_config.overshoot_weight = values.overshoot_weight
        self._grasps.reward_config.speed_threshold_m = values.speed_threshold_m
        self._grasps.sampler.set_ranges(list(values.radius_m), list(values.offset_m))
        return values
