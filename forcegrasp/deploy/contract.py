"""What a policy and its controller agree on: what a gripper reads, how that becomes an observation, and the limits."""

# pyright: standard

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

from forcegrasp.errors import closest
from forcegrasp.observation import PARTS

#: How many times harder than the first finger the last one is taken to touch: the object can't give way any more.
LAST_TOUCH = 2.0


@dataclass(frozen=True)
class GripperInterface:
    """What is read of a gripper, and so how many numbers everything has. Columns are named as in measurement sets.

    Raises:
      ValueError: if the values can't be right, in one line.
    """

    name: str
    unit: str  #: "m" or "rad", of positions and commands
    positions: tuple[str, ...]  #: one per motor, such as q_l_m
    forces: tuple[str, ...]  #: one per force channel, such as f_l_n; newtons

    def __post_init__(self) -> None:
        if self.unit not in ("m", "rad"):
            raise ValueError(f"unit={self.unit!r}: must be m or rad")
        for name in ("positions", "forces"):
            columns = getattr(self, name)
            if not columns or len(set(columns)) < len(columns):
                raise ValueError(f"{name}={list(columns)}: must name each reading once, and at least one")

    @property
    def needs(self) -> str:
        """How many readings of each kind a step takes."""
        counts = (("position", len(self.positions)), ("force", len(self.forces)))
        return " and ".join(f"{count} {kind}{'s' * (count > 1)}" for kind, count in counts)

    @property
    def one_to_one(self) -> bool:
        """Whether each motor has a force reading of its own."""
        return len(self.positions) == len(self.forces)

    def __str__(self) -> str:
        return f"{self.name} ({self.needs}: {', '.join((*self.positions, *self.forces))})"


@dataclass(frozen=True)
class Contract:
    """How readings become an observation and an action a command, and what must hold whatever the policy says.

    Lengths of positions are metres or radians, as the gripper's ``unit`` says.

    Raises:
      ValueError: if the values can't be right, in one line.
    """

    gripper: GripperInterface
    parts: tuple[str, ...]  #: parts of o(t), in this order
    frames: int  #: o(t) stacked, the oldest first; at the start the first one repeated
    position_scale_per_m: float  #: position part = scale · q + offset
    position_offset: float
    contact_threshold_n: float  #: f_θ; a force reading has shown contact once it exceeded this
    stall: float | None  #: only while its motor moved less than this in a step; None if however it moves
    inductive_bias: bool  #: whether Δq is scaled by φ (paper, eq. 7)
    bias_one_contact: float  #: φ of a finger that waits for the other
    bias_floor: float  #: smallest φ with both fingers in contact
    max_delta_m: float  #: Δq_max
    joint_range_m: tuple[float, float]  #: closed, open
    goal_range_n: tuple[float, float]  #: goal forces that were trained
    control_period_s: float  #: time from one step to the next
    ceiling_n: float  #: while a force reading is above this, no motor closes further
    position_reading_m: tuple[float, float]  #: readings beyond this can't be true
    force_reading_n: tuple[float, float]  #: readings beyond this can't be true
    gap_s: tuple[float, float]  #: shortest and longest time from one reading to the next
    memory: int = 0  #: numbers that the network remembers from one step of a grasp to the next
    gentle_n: float = 0.0  #: goal below which the last finger to touch closes slower on a hard object; 0: never

    def __post_init__(self) -> None:
        unknown = [part for part in self.parts if part not in PARTS]
        if unknown:
            raise ValueError(f"no observation part {unknown[0]!r}{closest(unknown[0], PARTS)}")
        simulated = [part for part in self.parts if PARTS[part].on_robot is None]
        if simulated:
            raise ValueError(
                f"observation.parts: {simulated[0]} has no form on a robot: write it (on_robot in"
                " forcegrasp/observation.py), or train without that part"
            )
        if not self.parts or len(set(self.parts)) < len(self.parts):
            raise ValueError("parts must name each part of the observation once, and at least one")
        if self.frames < 1:
            raise ValueError(f"frames={self.frames}: must be at least 1")
        if self.memory < 0:
            raise ValueError(f"memory={self.memory}: must not be negative")
        if self.gentle_n < 0:
            raise ValueError(f"gentle_n={self.gentle_n}: must not be negative")
        _check_finite(self)
        for name in ("bias_one_contact", "bias_floor"):
            if not 0 <= getattr(self, name) <= 1:
                raise ValueError(f"{name}={getattr(self, name)}: must lie in [0, 1]")
        for name in ("position_scale_per_m", "max_delta_m", "control_period_s"):
            if getattr(self, name) <= 0:
                raise ValueError(f"{name}={getattr(self, name)}: must be positive")
        if self.stall is not None and (self.stall <= 0 or not self.gripper.one_to_one):
            raise ValueError(f"stall={self.stall}: must be positive, and needs a force reading per motor")
        if self.goal_range_n[0] <= 0 or self.contact_threshold_n < 0 or self.gap_s[0] < 0:
            raise ValueError("goal_range_n, contact_threshold_n and gap_s must not reach below 0")
        if not self.goal_range_n[0] <= self.ceiling_n <= self.force_reading_n[1]:
            lowest, highest = self.goal_range_n[0], self.force_reading_n[1]
            raise ValueError(
                f"ceiling_n={self.ceiling_n:g}: must lie between the smallest goal, {lowest:g} N,"
                f" and the largest reading that can be true, {highest:g} N"
            )

    def columns(self, part: str) -> tuple[str, ...]:
        """What the numbers of a part belong to: a reading per motor, one per force channel, or the whole grasp."""
        return {"motor": self.gripper.positions, "force": self.gripper.forces, "grasp": (part,)}[PARTS[part].per]

    @property
    def observation_size(self) -> int:
        """Length of the stacked observation."""
        return sum(len(self.columns(part)) for part in self.parts) * self.frames

    @property
    def action_size(self) -> int:
        """How many motors are commanded."""
        return len(self.gripper.positions)

    def __str__(self) -> str:
        """The control loop in one line."""
        goal = " to ".join(f"{n:.4g}" for n in self.goal_range_n)
        in_metres = self.gripper.unit == "m"
        step = f"{self.max_delta_m * 1000:.4g} mm" if in_metres else f"{self.max_delta_m:.4g} {self.gripper.unit}"
        return (
            f"{self.gripper.name}, {1 / self.control_period_s:g} Hz, goal {goal} N, at most {step} a step,"
            f" ceiling {self.ceiling_n:.4g} N"
        )


@dataclass(frozen=True)
class ForcePIGains:
    """Gains of the hand-written controller.

    Raises:
      ValueError: if the values can't be right, in one line.
    """

    stiffness: float  #: k that it assumes, N/m or N/rad
    kp: float  #: K_p
    ki: float  #: K_i, 1/s
    closing_step: float  #: position delta of a control period while it closes, m or rad

    def __post_init__(self) -> None:
        _check_finite(self)
        for name in ("stiffness", "closing_step"):
            if getattr(self, name) <= 0:
                raise ValueError(f"{name}={getattr(self, name)}: must be positive")


def _check_finite(values: Contract | ForcePIGains) -> None:
    """Refuses numbers that are none, and ranges upside down."""
    for entry in dataclasses.fields(values):
        value = getattr(values, entry.name)
        numbers = [n for n in (value if isinstance(value, tuple) else [value]) if isinstance(n, (int, float))]
        if not all(map(math.isfinite, numbers)):
            raise ValueError(f"{entry.name}={value}: must be finite")
        if isinstance(value, tuple) and numbers and value[0] > value[1]:
            raise ValueError(f"{entry.name}={list(value)}: must be [low, high] with low ≤ high")
