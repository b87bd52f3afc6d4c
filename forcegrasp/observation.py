"""The parts of the observation o(t). The one list that options, environment, policies and robots take them from."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np


@dataclass(frozen=True)
class Readings:
    """What a robot computes parts from, float32."""

    position: np.ndarray  #: as read, m or rad, ``(motors,)``
    force: np.ndarray  #: as read, newtons, ``(channels,)``
    goal: np.float32  #: newtons
    last_action: np.ndarray  #: clipped to [−1, 1], ``(motors,)``
    had_contact: np.ndarray  #: 0 or 1, ``(channels,)``
    scale: np.float32  #: of the position part, 1/m or 1/rad
    offset: np.float32  #: of the position part


@dataclass(frozen=True)
class Part:
    """A part of o(t)."""

    name: str  #: in ``observation.parts``
    per: str  #: what it has a number for: each "motor", each "force" reading, or the "grasp" (as seen in a mirror, too)
    unit: str
    on_robot: Callable[[Readings], np.ndarray] | None = None  #: its form on a robot; without one it can't be exported
    entry: str = ""  #: of the environment, if not called as the part is
    transform: str = ""  #: module of forcegrasp.transforms whose ``make(gripper, sensors)`` writes it; "": always there

    def size(self, motors: int, forces: int) -> int:
        """How many numbers it has."""
        return {"motor": motors, "force": forces, "grasp": 1}[self.per]


PARTS = {
    part.name: part
    for part in (
        Part("position", "motor", "1, scaled", lambda r: r.position * r.scale + r.offset, entry="scaled_position"),
        Part("force", "force", "N", lambda r: r.force, entry="sensed_force"),
        Part("force_error", "force", "N", lambda r: r.goal - r.force),
        Part("last_action", "motor", "1", lambda r: r.last_action),
        Part("had_contact", "force", "0 or 1", lambda r: r.had_contact),
    )
}
#: The paper's, which a policy sees unless it is told otherwise.
DEFAULT_PARTS = tuple(part.name for part in PARTS.values() if not part.transform)
