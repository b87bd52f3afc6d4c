"""What a measurement set holds in memory, and the names of its columns on disk. SI units."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from forcegrasp.short_repr import ShortRepr, counted, cut

FORMAT = "forcegrasp-measurements/1"
SPLITS = ("fit", "check")
FINGERS = ("left", "right")
COMMAND = ("qdes_l_m", "qdes_r_m")
POSITION = ("q_l_m", "q_r_m")
FORCE = ("f_l_n", "f_r_n")
#: Every number of a sample that must be there, in the order of the file.
SIGNALS = ("t_s", *COMMAND, *POSITION, *FORCE)
OBJECT = "o_y_m"


@dataclass(frozen=True, repr=False)
class MeasuredGrasp(ShortRepr):
    """One recorded grasp of T samples. Columns of two are left and right finger; 0 m is closed, forces press if ≥ 0."""

    name: str
    object: str
    session: str
    radius_m: float | None  #: object radius; None if not given
    offset_m: float | None  #: object position along the grasp axis, towards the right finger; None if not given
    split: str | None  #: "fit", "check" or None
    time_s: np.ndarray  #: ``(T,)``
    command_m: np.ndarray  #: ``(T, 2)``, commanded at ``time_s`` and held until the next sample
    position_m: np.ndarray  #: ``(T, 2)``, read before that command acts
    force_n: np.ndarray  #: ``(T, 2)``, read before that command acts
    object_m: np.ndarray | None  #: ``(T,)``, object position along the grasp axis; None if not measured
    rows: np.ndarray | None = field(default=None, compare=False)  #: ``(T,)``, where the samples stand in their file

    def summary(self) -> str:
        return f"{cut(self.name)} on {cut(self.object)}, {counted(len(self.time_s), 'sample')}"

    def signals(self) -> dict[str, np.ndarray]:
        """Every measured signal by its column name, each ``(T,)``."""
        columns = [self.time_s, *self.command_m.T, *self.position_m.T, *self.force_n.T]
        named: dict[str, np.ndarray] = dict(zip(SIGNALS, columns, strict=True))
        return named if self.object_m is None else named | {OBJECT: self.object_m}


@dataclass(frozen=True, repr=False)
class MeasurementSet(ShortRepr):
    """Grasps that were recorded with one gripper."""

    path: Path  #: the folder, or what the set was converted from
    name: str
    gripper: str
    source: str
    license: str
    position_std_m: float | None  #: noise of the positions, if known
    force_std_n: float | None  #: noise of the forces, if known
    grasps: tuple[MeasuredGrasp, ...]
    fingerprint: str  #: sha256 of all that a result can depend on; see ``fingerprint_of_set``
    notes: tuple[str, ...] = field(default=(), compare=False)  #: what was odd when it was read, one line each

    def summary(self) -> str:
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

    def summary(self) -> str:
        objects = counted(len(set(self.objects)), "object")
        return f"{cut(self.name)}: {counted(len(self.objects), 'squeeze')} of {objects}, gripper {cut(self.gripper)}"


def fingerprint_of_set(
    gripper: str, position_std_m: float | None, force_std_n: float | None, grasps: Iterable[MeasuredGrasp]
) -> str:
    """Returns a sha256 in hex of the content: the same for CSV and Parquet, and whatever the order of the grasps.

    The folder's name, the source and the licence don't count: no result depends on them.
    """
    digest = _Digest("grasps", gripper, position_std_m, force_std_n)
    for grasp in sorted(grasps, key=lambda grasp: grasp.name):
        digest.facts(grasp.name, grasp.object, grasp.session, grasp.radius_m, grasp.offset_m, grasp.split)
        for name, values in grasp.signals().items():
            digest.numbers(name, values)
    return digest.hex()


def fingerprint_of_table(
    gripper: str, force_std_n: float | None, objects: Sequence[str], delta_q_m: np.ndarray, final_force_n: np.ndarray
) -> str:
    """Returns a sha256 in hex of the content of a table of final forces, whatever the order of its rows."""
    digest = _Digest("final_force", gripper, force_std_n)
    for row in sorted(zip(objects, delta_q_m.tolist(), final_force_n.tolist(), strict=True)):
        digest.facts(*row)
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
