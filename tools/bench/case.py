"""What is measured, and what came out."""

from __future__ import annotations

from dataclasses import dataclass

#: Control steps of an episode.
STEPS = 150


@dataclass(frozen=True)
class Case:
    """One thing to measure.

    Args:
      name: of a level or a peer.
      tier: of the physics.
      grasps: simulated at once; a peer has a process for each.
      threads: of the physics; 0 uses every core. Each process of a peer has one.
    """

    name: str
    tier: str
    grasps: int
    threads: int = 0


@dataclass(frozen=True)
class Measured:
    """Control steps per second, at best of the repeats, and peak memory of all its processes (None if unknown)."""

    case: Case
    steps_per_second: float
    memory_mb: float | None


@dataclass(frozen=True)
class Learning:
    """A training watched until a force reward.

    Args:
      name: of the stack.
      tier: of the physics.
      curve: ``(seconds, frames, reward)`` of each batch of training episodes.
      goal: force reward, normalised, that it should reach.
      limit_s: when it was given up.
    """

    name: str
    tier: str
    curve: list[tuple[float, int, float]]
    goal: float
    limit_s: float

    @property
    def reached(self) -> tuple[float, int, float] | None:
        """The first batch whose mean is at the goal; None if there was none."""
        return next((point for point in self.curve if point[2] >= self.goal), None)

    @property
    def best(self) -> float:
        """The best batch's mean; 0 if not even the first ended in time."""
        return max((reward for _, _, reward in self.curve), default=0.0)
