"""The names of signals: positions of the motors, and then forces, as many as a gripper's description has."""

from __future__ import annotations

from dataclasses import dataclass

from forcegrasp.physics.gripper import Gripper


@dataclass(frozen=True)
class SignalAxis:
    """The last axis of measured and predicted signals, ``C`` long."""

    gripper: Gripper

    def __len__(self) -> int:
        return len(self.names)

    @property
    def names(self) -> list[str]:
        """The channels' names, such as position_l."""
        return [channel.name for channel in self.gripper.positions + self.gripper.forces]

    @property
    def units(self) -> list[str]:
        """The channels' units: m, rad or N."""
        return [channel.unit for channel in self.gripper.positions + self.gripper.forces]

    @property
    def positions(self) -> slice:
        """Which channels are positions of motors."""
        return slice(0, len(self.gripper.positions))

    @property
    def forces(self) -> slice:
        """Which channels are forces; it may be none."""
        return slice(len(self.gripper.positions), len(self))

    @property
    def kinds(self) -> dict[str, slice]:
        """Channels of one kind, those that there are."""
        both = {"position": self.positions, "force": self.forces}
        return {kind: part for kind, part in both.items() if part.stop > part.start}

    def kind_of(self, name: str) -> str:
        """The kind that a channel is of."""
        channel = self.names.index(name)
        return next(kind for kind, part in self.kinds.items() if part.start <= channel < part.stop)

    @property
    def sides(self) -> list[list[int]]:
        """Position and force, if any, of each side; a channel that both sides share is in both."""
        parts = list(self.kinds.values())
        count = max(part.stop - part.start for part in parts)
        return [[min(part.start + side, part.stop - 1) for part in parts] for side in range(count)]

    def side_of(self, channel: int) -> list[int]:
        """The side that a channel is of, as in :attr:`sides`."""
        return next(side for side in self.sides if channel in side)
