"""The learning curriculum: a schedule, and the hook that applies it."""

from forcegrasp.curriculum.hook import CurriculumHook
from forcegrasp.curriculum.schedule import CurriculumValues, LinearSchedule

__all__ = ["CurriculumHook", "CurriculumValues", "LinearSchedule"]
