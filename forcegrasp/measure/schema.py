"""What a measurement set holds in memory, and the names of its columns on disk. SI units."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from forcegrasp.short_repr import ShortRepr, counted, cut

if TYPE_CHECKING:
    from forcegrasp.physics.gripper import Gripper

FORMAT = "forcegrasp-measurements/1"
SPLITS = ("fit", "check")
OBJECT = "o_y_m"
#: Standard deviations of radii and places of objects where a set gives none: a calliper's on something not quite round,
#: and a mark's on the table.
RADIUS_STD_M, OFFSET_STD_M = 5e-5, 5e-4
#: Those of the clock, as a share, and of the time between a row's command and its readings: a microcontroller's own
#: oscillator, trimmed, and one exchange on a serial bus.
PERIOD_STD_SHARE, DELAY_STD_S = 2e-3, 2e-3
#: What meta.yaml calls these, and what a set does.
TOLERANCES = {
    "object_radius_std_m": ("radius_std_m", RADIUS_STD_M),
    "object_offset_std_m": ("offset_std_m", OFFSET_STD_M),
    "period_std_share": ("period_std_share", PERIOD_STD_SHARE),
    "delay_std_s": ("delay_std_s", DELAY_STD_S),
}
#: Of servos: whether the motor is switched on (1 or 0), and a force or torque from outside, N or N·m.
ENABLED, LOAD = "enabled", "load"
_SIDES = {"l": "left", "r": "right"}


@dataclass(frozen=True)
class Columns:
    """Names of what a gripper's samples hold: a command and a position per motor, and its force channels."""

    command: tuple[str, ...]
    position: tuple[str, ...]
    force: tuple[str, ...]

    @property
    def signals(self) -> tuple[str, ...]:
        """Every number of a sample that must be there, in the order of the file."""
        return ("t_s", *self.command, *self.position, *self.force)

    @property
    def unit(self) -> str:
        """Unit of commands and positions: "m" or "rad"."""
        return self.position[0].rpartition("_")[2]

    @property
    def are_pads(self) -> bool:
        """Whether positions and forces are those of a left and a right pad, each with a motor of its own."""
        return self == TWO_FINGERS

    @property
    def read_effort(self) -> bool:
        """Whether the only force is the effort of the only motor; sensors are those of a left or a right finger."""
        return len(self.position) == 1 and self.force == ("f_n",)


#: Of a gripper whose two fingers have a sliding motor and a force sensor each.
TWO_FINGERS = Columns(("qdes_l_m", "qdes_r_m"), ("q_l_m", "q_r_m"), ("f_l_n", "f_r_n"))


def columns_of(gripper: Gripper) -> Columns:
    """The columns of a gripper's samples."""
    named = (tuple(c.column for c in channels) for channels in (gripper.commands, gripper.positions, gripper.forces))
    return Columns(*named)


def side_of(column: str) -> str:
    """Which finger or motor a column belongs to: "left" or "right"; "" if it is the only one."""
    return _SIDES.get(column.split("_")[1], "")


@dataclass(frozen=True, repr=False)
class MeasuredGrasp(ShortRepr):
    """One recorded grasp of T samples. A position of 0 is closed, forces press if ≥ 0; ``columns`` tells the order."""

    name: str
    object: str
    session: str
    radius_m: float | None  #: object radius; None if not given
    offset_m: float | None  #: object position along the grasp axis, towards the right finger; None if not given
    split: str | None  #: "fit", "check" or None
    time_s: np.ndarray  #: ``(T,)``
    command_m: np.ndarray  #: m or rad, ``(T, motors)``, commanded at ``time_s`` and held until the next sample
    position_m: np.ndarray  #: m or rad, ``(T, motors)``, read before that command acts
    force_n: np.ndarray  #: ``(T, channels)``, read before that command acts
    object_m: np.ndarray | None  #: ``(T,)``, object position along the grasp axis; None if not measured
    rows: np.ndarray | None = field(default=None, compare=False)  #: ``(T,)``, where the samples stand in their file
    columns: Columns = TWO_FINGERS
    settings: Mapping[str, float] = field(default_factory=dict)  #: of a servo's recording, such as kp
    enabled: np.ndarray | None = None  #: ``(T,)``, whether the motor was switched on; None if always
    load: np.ndarray | None = None  #: ``(T,)``, force or torque from outside, N or N·m; None if there was none
    #: Of a part of a recording: where the motors stood and how fast they moved at its start, and what of it counts.
    start: tuple[np.ndarray, ...] | None = field(default=None, compare=False)
    start_std: tuple[np.ndarray, ...] | None = field(default=None, compare=False)  #: standard errors of both
    counts: np.ndarray | None = field(default=None, compare=False)  #: ``(T,)``
    #: Of a part of a recording, the samples before it: when ``(P,)``, what was commanded, and where the motors were,
    #: ``(P, motors)`` each.
    before: tuple[np.ndarray, np.ndarray, np.ndarray] | None = field(default=None, compare=False)
    #: How much later than ``time_s`` positions and forces were read; not in any file, but found within a tolerance.
    late_s: tuple[float, float] = field(default=(0.0, 0.0), compare=False)
    mass_kg: float | None = None  #: of the object; the scene's if not given
    #: Standard deviations of radius and offset, metres, where they are to be fitted within them; 0 takes them as given.
    fitted_m: tuple[float, float] = field(default=(0.0, 0.0), compare=False)

    def summary(self) -> str:
        return f"{cut(self.name)} on {cut(self.object)}, {counted(len(self.time_s), 'sample')}"

    @property
    def label(self) -> str:
        """Its name, and that of the object, if there is one."""
        return f"{self.name} on {self.object}" if self.object else self.name

    def signals(self) -> dict[str, np.ndarray]:
        """Every measured signal by its column name, each ``(T,)``."""
        values = [self.time_s, *self.command_m.T, *self.position_m.T, *self.force_n.T]
        named: dict[str, np.ndarray] = dict(zip(self.columns.signals, values, strict=True))
        extra = {OBJECT: self.object_m, ENABLED: self.enabled, LOAD: self.load}
        return named | {name: np.asarray(values, float) for name, values in extra.items() if values is not None}


@dataclass(frozen=True, repr=False)
class MeasurementSet(ShortRepr):
    """Grasps that were recorded with one gripper."""

    path: Path  #: the folder, or what the set was converted from; of joined sets all folders, [a,b]
    name: str
    gripper: str
    source: str
    license: str
    position_std_m: float | None  #: noise of the positions, m or rad, if known
    force_std_n: float | None  #: noise of the forces, if known
    grasps: tuple[MeasuredGrasp, ...]
    fingerprint: str  #: sha256 of all that a result can depend on; see ``fingerprint_of_set``
    notes: tuple[str, ...] = field(default=(), compare=False)  #: what was odd when it was read, one line each
    radius_std_m: float = RADIUS_STD_M  #: standard deviation of the radii that are given
    offset_std_m: float = OFFSET_STD_M  #: that of the objects' places
    period_std_share: float = PERIOD_STD_SHARE  #: that of the clock's rate
    delay_std_s: float = DELAY_STD_S  #: that of the time from a row's command to its readings
    kind: str = "grasps"  #: or "servo": recordings of a mechanism that grasps nothing

    @property
    def columns(self) -> Columns:
        """What its samples hold, which is the same in all grasps."""
        return self.grasps[0].columns if self.grasps else TWO_FINGERS

    def summary(self) -> str:
        if self.kind == "servo":
            return f"{cut(self.name)}: {counted(len(self.grasps), 'recording')}, mechanism {cut(self.gripper)}"
        objects = counted(len({grasp.object for grasp in self.grasps}), "object")
        return f"{cut(self.name)}: {counted(len(self.grasps), 'grasp')} of {objects}, gripper {cut(self.gripper)}"


@dataclass(frozen=True, repr=False)
class FinalForceTable(ShortRepr):
    """Final forces only: n squeezes, each by a commanded position delta."""

    path: Path
    name: str
    gripper: str
    source: str
    license: str
    force_std_n: float | None  #: noise of the forces, if known
    objects: tuple[str, ...]  #: object of each row
    delta_q_m: np.ndarray  #: ``(n,)``
    final_force_n: np.ndarray  #: ``(n,)``
    fingerprint: str  #: sha256 of all that a result can depend on
    notes: tuple[str, ...] = field(default=(), compare=False)  #: what was odd when it was read, one line each
    sessions: tuple[str, ...] = ()  #: session of each row; empty if the table does not say

    def summary(self) -> str:
        objects = counted(len(set(self.objects)), "object")
        return f"{cut(self.name)}: {counted(len(self.objects), 'squeeze')} of {objects}, gripper {cut(self.gripper)}"


def fingerprint_of_set(
    gripper: str,
    position_std_m: float | None,
    force_std_n: float | None,
    grasps: Iterable[MeasuredGrasp],
    tolerances: Mapping[str, float] | None = None,
) -> str:
    """Returns a sha256 in hex of the content: the same for CSV and Parquet, and whatever the order of the grasps.

    The folder's name, the source and the licence don't count: no result depends on them. ``tolerances`` are those by
    the keys of :data:`TOLERANCES`.
    """
    digest = _Digest("grasps", gripper, position_std_m, force_std_n)
    stds = {key: usual for key, (_, usual) in TOLERANCES.items()} | dict(tolerances or {})
    of_objects, of_time = tuple(stds.values())[:2], tuple(stds.values())[2:]
    if of_objects != (RADIUS_STD_M, OFFSET_STD_M):  # sets from before they could be given keep theirs
        digest.facts(*of_objects)
    if of_time != (PERIOD_STD_SHARE, DELAY_STD_S):
        digest.facts("time", *of_time)
    for grasp in sorted(grasps, key=lambda grasp: grasp.name):
        digest.facts(grasp.name, grasp.object, grasp.session, grasp.radius_m, grasp.offset_m, grasp.split)
        if grasp.mass_kg is not None:
            digest.facts("mass", grasp.mass_kg)
        for name in sorted(grasp.settings):
            digest.facts(name, grasp.settings[name])
        for name, values in grasp.signals().items():
            digest.numbers(name, values)
    return digest.hex()


def fingerprint_of_table(
    gripper: str,
    force_std_n: float | None,
    objects: Sequence[str],
    delta_q_m: np.ndarray,
    final_force_n: np.ndarray,
    sessions: Sequence[str] = (),
) -> str:
    """Returns a sha256 in hex of the content of a table of final forces, whatever the order of its rows."""
    digest = _Digest("final_force", gripper, force_std_n)
    columns = [objects, delta_q_m.tolist(), final_force_n.tolist(), *([sessions] if sessions else [])]
    for row in sorted(zip(*columns, strict=True)):
        digest.facts(*row)
    return digest.hex()


def fingerprint_of_parts(fingerprints: Iterable[str], names: Iterable[str]) -> str:
    """Returns a sha256 in hex of joined sets, whatever their order: of theirs, and the names that results use."""
    digest = _Digest("joined", *sorted(fingerprints))
    digest.facts(*sorted(names))
    return digest.hex()


class _Digest:
    """A hash over facts and numbers, each with its length, so that nothing can run into its neighbour."""

    def __init__(self, *facts: str | float | None) -> None:
        self._hash = hashlib.sha256()
        self.facts(FORMAT, *facts)

    def facts(self, *values: str | float | None) -> None:
        values = tuple(value + 0.0 if isinstance(value, float) else value for value in values)  # -0.0 is 0.0
        self._hash.update(json.dumps(values).encode() + b"\n")

    def numbers(self, name: str, values: np.ndarray) -> None:
        self.facts(name, len(values))
        self._hash.update((np.asarray(values, "<f8") + 0.0).tobytes())

    def hex(self) -> str:
        return self._hash.hexdigest()
