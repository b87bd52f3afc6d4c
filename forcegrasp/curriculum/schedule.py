"""The paper's curriculum as a pure function of the frames trained so far (paper, Table 2)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from forcegrasp.config import CurriculumConfig, GraspConfig, RewardConfig
from forcegrasp.physics import Gripper, default_gripper
from forcegrasp.physics.completion import complete


@dataclass(frozen=True)
class CurriculumValues:
    """What the curriculum anneals."""

    object_weight: float  #: α₂
    speed_threshold_m: float  #: velocity threshold, metres per control step
    overshoot_weight: float  #: weight of r_over
    radius_m: tuple[float, float]  #: range of object radii, W_o, metres
    offset_m: tuple[float, float]  #: range of object offsets, O_y, metres

    def scalars(self) -> dict[str, float]:
        """Named numbers, for logs."""
        return {
            "object_weight": self.object_weight,
            "speed_threshold_m": self.speed_threshold_m,
            "overshoot_weight": self.overshoot_weight,
            "radius_low_m": self.radius_m[0],
            "radius_high_m": self.radius_m[1],
            "offset_low_m": self.offset_m[0],
            "offset_high_m": self.offset_m[1],
        }


def _mix(start: Any, end: Any, share: float) -> Any:
    """Linear interpolation of numbers and of ranges, exact at both ends."""
    if isinstance(start, (list, tuple)):
        return tuple(_mix(a, b, share) for a, b in zip(start, end, strict=True))
    return float((1 - share) * start + share * end)


class LinearSchedule:
    """Interpolates from the start values to the final ones over the first ``end_frames`` frames, then stays.

    Args:
      curriculum: start values, and the share of training over which they are annealed.
      grasp, reward: the final values.
      total_frames: frames of the whole training.
      gripper: whose ranges stand in for those left out; the paper's by default.
    """

    def __init__(
        self,
        curriculum: CurriculumConfig,
        grasp: GraspConfig,
        reward: RewardConfig,
        total_frames: int,
        gripper: Gripper | None = None,
    ) -> None:
        gripper = gripper or default_gripper()
        curriculum, grasp = complete(curriculum, gripper), complete(grasp, gripper)
        self.end_frames = curriculum.end_fraction * total_frames if curriculum.enabled else 0.0
        weighted = ((one.object_weight, one.speed_threshold_m, one.overshoot_weight) for one in (curriculum, reward))
        ranges = ((one.radius_m, one.offset_m) for one in (curriculum, grasp))
        self._start, self._end = (w + r for w, r in zip(weighted, ranges, strict=True))

    def __call__(self, frames: int) -> CurriculumValues:
        """The values after this many frames."""
        share = 1.0 if self.end_frames == 0 else min(frames / self.end_frames, 1.0)
        return CurriculumValues(*(_mix(a, b, share) for a, b in zip(self._start, self._end, strict=True)))
