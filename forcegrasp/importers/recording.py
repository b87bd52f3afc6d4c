"""What every format of a servo's log is brought to: one recording of some joints, in SI units."""

from __future__ import annotations

import dataclasses
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


def is_jaw(joint: str) -> bool:
    """Whether a joint is a gripper's, by its name."""
    return any(word in joint.lower() for word in ("jaw", "gripper"))


def unlike_a_jaw(one: Recording) -> str:
    """What to say where a recording may be of no jaw, which is what it is compared with by default."""
    others = ", ".join(joint for joint in one.joints if not is_jaw(joint))
    return f"so101_jaw is an empty jaw without gravity: if {others} is none, give mechanism=" if others else ""


class OtherFileError(MeasurementError):
    """A file that is no recording of the format at all; in a folder it is left out."""


def files_below(source: Path, *patterns: str) -> list[Path]:
    """The file itself, or the files in and below a folder whose names are like a pattern; hidden ones are left out."""
    if source.is_file():
        return [source]
    found = {file: file.relative_to(source).parts for pattern in patterns for file in source.glob(f"**/{pattern}")}
    return sorted(file for file, parts in found.items() if not any(part.startswith(".") for part in parts))


def tidy(one: Recording) -> Recording:
    """Without rows that lack a number, and without rows that repeat a time stamp; notes say how many.

    Raises:
      MeasurementError: if less than two rows are left, or time runs back.
    """
    signals = [
        one.time_s,
        one.command,
        one.position,
        *(v for v in (one.effort, one.enabled, one.load) if v is not None),
    ]
    whole = np.all([np.isfinite(np.asarray(v, float)).reshape(len(v), -1).all(axis=1) for v in signals], axis=0)
    times = one.time_s[whole]
    new = np.r_[True, np.diff(times) != 0][: len(times)]
    if (np.diff(times[new]) < 0).any():
        row = int(np.argmax(np.diff(times[new]) < 0))
        before, after = times[new][row : row + 2]
        raise MeasurementError(
            f"{one.name}: time runs back from {before:.6g} to {after:.6g} s; sort the rows, or if these are several"
            " recordings name the column that tells them apart: `recording: run`"
        )
    notes = [
        f"{one.name}: left out {counted(count, 'row')} {what}"
        for count, what in (
            (int((~whole).sum()), "without a number"),
            (int((~new).sum()), "with a time stamp that was there"),
        )
        if count
    ]
    keep = np.flatnonzero(whole)[new]
    if len(keep) < 2:
        raise MeasurementError(f"{one.name}: needs at least two rows with a number in every column that is asked for")
    cut = {
        name: None if values is None else values[keep]
        for name in ("time_s", "command", "position", "effort", "enabled", "load")
        for values in (getattr(one, name),)
    }
    enabled = None if cut["enabled"] is None else cut["enabled"] > 0.5
    since = one.time_s[keep] - one.time_s[keep[0]]
    return dataclasses.replace(one, **(cut | {"time_s": since, "enabled": enabled}), notes=(*one.notes, *notes))
