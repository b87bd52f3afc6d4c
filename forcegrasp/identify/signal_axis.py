"""The names of signals: positions of the motors, and then forces, as many as a gripper's description has."""

from __future__ import annotations

from forcegrasp.physics.gripper import Gripper


class SignalAxis:
    """The last axis of measured and predicted signals, ``C`` long, as a gripper's description names it."""

    def __init__(self, gripper: Gripper) -> None:
        channels, motors = gripper.positions + gripper.forces, len(gripper.positions)
        self.names = [channel.name for channel in channels]  #: such as position_l
        self.units = [channel.unit for channel in channels]  #: m, rad or N
        self.positions = slice(0, motors)  #: which are positions of motors
        self.forces = slice(motors, len(channels))  #: which are forces; it may be none
        both = {"position": self.positions, "force": self.forces}
        #: channels of one kind, those that there are
        self.kinds = {kind: part for kind, part in both.items() if part.stop > part.start}

    def __len__(self) -> int:
        return len(self.names)

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
