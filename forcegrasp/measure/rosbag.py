"""Turns a ROS bag (ROS 1 .bag, ROS 2 folder, MCAP) into a measurement set, as a small YAML file says how.

```yaml
bag: pick.bag              # relative to this file
gripper: tiago
source: ...
license: ...
clock: qdes_l_m            # a sample is taken at each message of this signal
signals:
  qdes_l_m: {topic: /left/command, field: data}
  q_l_m: {topic: /joint_states, field: "position[name=gripper_left]", scale: 1, offset: 0}  # scale × field + offset
  ...
grasps:                    # times in seconds since the first message of the bag
  - {grasp: 1, object: sponge, session: a, start_s: 0.5, end_s: 4.5, object_radius_m: 0.025}  # object_offset_m, split
```
Every other signal gives its newest reading at or before that time. Nothing is interpolated.
"""

# pyright: reportMissingImports=false

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from forcegrasp.errors import MeasurementError, closest
from forcegrasp.measure.folder import MAX_NAME, MAX_ROWS, show
from forcegrasp.measure.read import MAX_TEXT, NOISE, gripper_columns, side_by_side
from forcegrasp.measure.samples import check_samples
from forcegrasp.measure.schema import (
    OBJECT,
    SPLITS,
    Columns,
    MeasuredGrasp,
    MeasurementSet,
    fingerprint_of_set,
)
from forcegrasp.measure.yaml_file import Reader, load_yaml

_STEP = re.compile(r"(\w+)(?:\[(?:(\d+)|(\w+)=([^\]]+))\])?", re.ASCII)


@dataclass(frozen=True)
class _Signal:
    """Where a signal comes from. Steps are (field, index, field to look the index up in, what to look up)."""

    topic: str
    field: str
    steps: tuple[tuple[str, int | None, str, str], ...]
    scale: float
    offset: float

    def value(self, message: Any) -> float | None:
        """The value in a message; None if a name that is looked up is not in it. Raises if the field is wrong."""
        for name, index, names, wanted in self.steps:
            parent, message = message, getattr(message, name)
            if names:
                listed = list(getattr(parent, names))
                if wanted not in listed:
                    return None
                index = listed.index(wanted)
            if index is not None:
                message = message[index]
        return self.scale * float(message) + self.offset


def convert_bag(mapping_file: str | Path) -> MeasurementSet:
    """Returns the grasps in a bag, as the mapping file says.

    Args:
      mapping_file: YAML as above; ``o_y_m`` is the one signal that may be left out.

    Raises:
      MeasurementError: if the extra ``rosbag`` is not installed, or the mapping does not fit the bag.
    """
    path = Path(mapping_file)
    place = show(path)
    required = ("bag", "gripper", "source", "license", "clock", "signals", "grasps")
    top = Reader(load_yaml(path), place, required, NOISE)
    columns, known = gripper_columns(top, path.parent), top.get("signals")
    mapping = Reader(known, f"{place}: signals", columns.signals[1:], (OBJECT,))
    signals = {name: _signal(mapping.get(name), f"{place}: signals: {name}") for name in known}
    clock = top.text("clock", MAX_NAME)
    if clock not in signals:
        raise top.refuse("clock", f"{show(clock)} is no signal{closest(clock, signals)}")
    if not isinstance(top.get("grasps"), list) or not top.get("grasps"):
        raise top.refuse("grasps", "must be a list with one entry per grasp")
    readings = _read_bag(path.parent / top.text("bag", MAX_TEXT), signals)
    grasps = tuple(
        _cut(entry, f"{place}: grasps, entry {number}", clock, readings, columns)
        for number, entry in enumerate(top.get("grasps"), 1)
    )
    for number, grasp in enumerate(grasps, 1):
        if grasp.name in [other.name for other in grasps[: number - 1]]:
            raise MeasurementError(f"{place}: grasps, entry {number}: {show(grasp.name)} is there twice; rename it")
        check_samples(path, grasp)
    facts = {
        "gripper": top.text("gripper", MAX_NAME),
        "position_std_m": top.positive("position_std_m"),
        "force_std_n": top.positive("force_std_n"),
        "grasps": grasps,
    }
    return MeasurementSet(
        path=path,
        name=path.stem,
        source=top.text("source", MAX_TEXT, lines=True),
        license=top.text("license", MAX_TEXT, lines=True),
        fingerprint=fingerprint_of_set(**facts),
        **facts,
    )


def _signal(entry: Any, place: str) -> _Signal:
    reader = Reader(entry, place, ("topic", "field"), ("scale", "offset"))
    field = reader.text("field", 1000)
    steps = []
    for part in re.split(r"\.(?![^\[]*\])", field):  # dots, but not those in [name=a.b]
        match = _STEP.fullmatch(part)
        if not match:
            raise reader.refuse("field", f"{show(field)} must look like a.b, a[0].b or position[name=joint]")
        name, index, names, wanted = match.groups()
        steps.append((name, int(index) if index else None, names or "", wanted or ""))
    scale = reader.number("scale", 1.0)
    if not scale:
        raise reader.refuse("scale", "must not be 0")
    return _Signal(reader.text("topic", 1000), field, tuple(steps), scale, reader.number("offset", 0.0) or 0.0)


def _read_bag(path: Path, signals: dict[str, _Signal]) -> dict[str, np.ndarray]:
    """Returns for each signal its times, in seconds since the bag's first message, and values, ``(n, 2)``."""
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError as error:
        raise MeasurementError("reading bags needs an extra: pip install 'forcegrasp[rosbag]'") from error
    wanted: dict[str, list[str]] = {}
    for name, signal in signals.items():
        wanted.setdefault(signal.topic, []).append(name)
    readings: dict[str, list[tuple[float, float]]] = {name: [] for name in signals}
    try:
        with AnyReader([path], default_typestore=get_typestore(Stores.LATEST)) as bag:
            topics = {connection.topic for connection in bag.connections}
            for name, signal in signals.items():
                if signal.topic not in topics:
                    hint = closest(signal.topic, topics)
                    raise MeasurementError(f"{show(path)}: {name}: no topic {show(signal.topic)}{hint}")
            connections = [connection for connection in bag.connections if connection.topic in wanted]
            for connection, stamp, data in bag.messages(connections):
                message = bag.deserialize(data, connection.msgtype)
                for name in wanted[connection.topic]:
                    value = _value(path, name, signals[name], message, connection.msgtype)
                    if value is not None:
                        readings[name].append(((stamp - bag.start_time) / 1e9, value))
                        if len(readings[name]) > MAX_ROWS:
                            raise MeasurementError(f"{show(path)}: more than {MAX_ROWS:,} messages; split the bag")
    except MeasurementError:
        raise
    except Exception as error:  # whatever rosbags, SQLite, the decompressors and the disk can say about a broken bag
        reason = " ".join(str(error).split()) or type(error).__name__
        raise MeasurementError(f"{show(path)}: not a bag that can be read: {show(reason, 150)}") from error
    for name, values in readings.items():
        if not values:
            raise MeasurementError(f"{show(path)}: {name}: never {show(signals[name].field)} in {signals[name].topic}")
    return {name: np.array(values) for name, values in readings.items()}


def _value(path: Path, name: str, signal: _Signal, message: Any, kind: str) -> float | None:
    try:
        return signal.value(message)
    except (AttributeError, IndexError, TypeError, ValueError) as error:
        fields = [field for field in getattr(message, "__dataclass_fields__", {}) if field != "__msgtype__"]
        raise MeasurementError(
            f"{show(path)}: {name}: no number at {show(signal.field)} of {signal.topic}, a {kind} of"
            f" {', '.join(fields)} ({' '.join(str(error).split())})"
        ) from error


def _cut(entry: Any, place: str, clock: str, readings: dict[str, np.ndarray], columns: Columns) -> MeasuredGrasp:
    """One grasp: a sample at each message of the clock, with the newest reading of all other signals."""
    required = ("grasp", "object", "session", "start_s", "end_s")
    reader = Reader(entry, place, required, ("object_radius_m", "object_offset_m", "split"))
    split = reader.text("split", MAX_NAME) if reader.get("split") else None
    if split not in (None, *SPLITS):
        raise reader.refuse("split", f"{show(split)} is unknown{closest(split or '', SPLITS)}")
    start, end = reader.number("start_s"), reader.number("end_s")
    if start is None or end is None or start >= end:
        raise reader.refuse("end_s", "must be a time after start_s, in seconds since the bag's first message")
    time = readings[clock][:, 0]
    time = time[(time >= start) & (time <= end)]
    if not len(time):
        ends = readings[clock][[0, -1], 0]
        raise reader.refuse("start_s", f"no message of {clock} until end_s; the bag has some from {ends[0]:g} s")
    cut = {"t_s": time}
    for name, values in readings.items():
        newest = np.searchsorted(values[:, 0], time, side="right") - 1
        if newest[0] < 0:
            raise reader.refuse("start_s", f"{name} has no reading before {values[0, 0]:g} s; start later")
        cut[name] = values[newest, 1]
    return MeasuredGrasp(
        name=reader.text("grasp", MAX_NAME),
        object=reader.text("object", MAX_NAME),
        session=reader.text("session", MAX_NAME),
        radius_m=reader.positive("object_radius_m"),
        offset_m=reader.number("object_offset_m"),
        split=split,
        time_s=time,
        command_m=side_by_side(cut, columns.command),
        position_m=side_by_side(cut, columns.position),
        force_n=side_by_side(cut, columns.force),
        object_m=cut.get(OBJECT),
        columns=columns,
    )
