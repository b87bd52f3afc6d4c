"""What every format of a servo's log is brought to: one recording of some joints, in SI units."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from forcegrasp.errors import MeasurementError
from forcegrasp.short_repr import ShortRepr, counted


@dataclass(frozen=True, repr=False)
class Recording(ShortRepr):
    """One recording: T instants of J joints, positions in m or rad. A command is held until the next instant."""

    name: str
    joints: tuple[str, ...]
    time_s: np.ndarray  #: of the commands, ``(T,)``
    command: np.ndarray  #: what was commanded, in ``command_unit``, ``(T, J)``
    position: np.ndarray  #: what the encoders said, m or rad, ``(T, J)``
    command_unit: str = ""  #: "N", "N·m" or "V" where forces or voltages were commanded; positions otherwise
    effort: np.ndarray | None = None  #: torque, force, current or load, ``(T, J)``
    effort_unit: str = ""
    effort_signed: bool = True
    enabled: np.ndarray | None = None  #: whether the motor was switched on, ``(T,)``
    load: np.ndarray | None = None  #: force or torque from outside, N or N·m, ``(T,)``
    settings: Mapping[str, float] = field(default_factory=dict)  #: what was set for the whole recording: kp, a mass
    notes: tuple[str, ...] = ()  #: what was guessed or left out

    def summary(self) -> str:
        return f"{self.name}: {counted(len(self.time_s), 'sample')} of {', '.join(self.joints)}"

    def of_joints(self, wanted: Sequence[str]) -> Recording:
        """The same with these joints alone, in this order.

        Raises:
          MeasurementError: if one is not in it; all that are missing are named.
        """
        missing = [name for name in wanted if name not in self.joints]
        if missing:
            raise MeasurementError(
                f"joints={list(wanted)}: no {', '.join(missing)} in {self.name}; it has {', '.join(self.joints)}"
            )
        pick = [self.joints.index(name) for name in wanted]
        effort = None if self.effort is None else self.effort[:, pick]
        return Recording(
            self.name, tuple(wanted), self.time_s, self.command[:, pick], self.position[:, pick], self.command_unit,
            effort, self.effort_unit, self.effort_signed, self.enabled, self.load, self.settings, self.notes,
        )  # fmt: skip


def files_below(source: Path, pattern: str) -> list[Path]:
    """The file itself, or the files of a folder, and of those below it, whose names are like the pattern."""
    return [source] if source.is_file() else sorted(source.glob(f"**/{pattern}"))


def steady_rate(name: str, time_s: np.ndarray) -> None:
    """Refuses times that do not ascend, and gaps or rates that show a wrong unit.

    Raises:
      MeasurementError: row and what to do.
    """
    step = np.diff(time_s)
    if len(step) == 0 or not np.isfinite(time_s).all():
        raise MeasurementError(f"{name}: needs at least two samples, with finite times")
    if (step <= 0).any():
        row = int(np.argmax(step <= 0)) + 1
        raise MeasurementError(f"{name}: time does not ascend at sample {row} ({time_s[row]:g} s)")
    middle = float(np.median(step))
    if not 2e-5 <= middle <= 0.5:
        unit = "seconds taken as milliseconds" if middle < 2e-5 else "milliseconds or microseconds taken as seconds"
        raise MeasurementError(f"{name}: {middle:.3g} s from sample to sample: looks like {unit}; give the time's unit")
