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
  - {grasp: 1, object: sponge, session: a, start_s: 0.5, end_s: 4.5, object_radius_m: 0.025}
                           # object_offset_m, object_mass_kg, split
```
Every other signal gives its newest reading at or before that time. Nothing is interpolated.
"""

# pyright: reportMissingImports=false

from __future__ import annotations

import functools
import re
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, model_validator

from forcegrasp.errors import MeasurementError, closest
from forcegrasp.files.validate import counted, must, refusal, text, validate, wrong
from forcegrasp.measure.folder import MAX_ROWS, described, show
from forcegrasp.measure.joined import side_by_side
from forcegrasp.measure.names import misfits
from forcegrasp.measure.samples import check_samples
from forcegrasp.measure.schema import (
    OBJECT,
    Columns,
    MeasuredGrasp,
    MeasurementSet,
    columns_of,
    fingerprint_of_set,
)
from forcegrasp.measure.yaml_file import Name, Number, Positive, Text, TextRecord, load_yaml

_STEP = re.compile(r"(\w+)(?:\[(?:(\d+)|(\w+)=([^\]]+))\])?", re.ASCII)


_LongText = Annotated[str, text(1000)]


def _steps(field: str) -> list[tuple[Any, ...]]:
    """Steps to a number in a message: (field, index, field to look the index up in, what to look up)."""
    parts = re.split(r"\.(?![^\[]*\])", field)  # dots, but not those in [name=a.b]
    found = [_STEP.fullmatch(part) for part in parts]
    if not all(found):
        raise wrong(f"{show(field)} must look like a.b, a[0].b or position[name=joint]")
    return [match.groups() for match in found if match]


class Signal(TextRecord):
    """Where a signal comes from."""

    topic: _LongText
    field: Annotated[_LongText, AfterValidator(lambda field: _steps(field) and field)]
    scale: Annotated[Number, must(bool, "must not be 0")] = 1.0
    offset: Number = 0.0

    @functools.cached_property
    def steps(self) -> list[tuple[Any, ...]]:
        return _steps(self.field)

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
                message = message[int(index)]
        return self.scale * float(message) + self.offset


class _Cut(TextRecord):
    """One grasp in a bag. Times are in seconds since the bag's first message."""

    grasp: Name
    object: Name
    session: Name
    start_s: Number
    end_s: Number
    object_radius_m: Positive | None = None
    object_offset_m: Number | None = None
    object_mass_kg: Positive | None = None
    split: Literal["fit", "check"] | None = None

    @model_validator(mode="after")
    def _lasts(self) -> _Cut:
        if self.start_s >= self.end_s:
            raise wrong("must be a time after start_s, in seconds since the bag's first message", "end_s")
        return self


class _Mapping(TextRecord):
    bag: Text
    gripper: Name
    source: Text
    license: Text
    position_std_m: Positive | None = None
    force_std_n: Positive | None = None
    clock: Name
    signals: dict[str, Signal]
    grasps: Annotated[tuple[_Cut, ...], counted(1, MAX_ROWS, "a list with one entry per grasp")]


def convert_bag(mapping_file: str | Path) -> MeasurementSet:
    """Returns the grasps in a bag, as the mapping file says.

    Args:
      mapping_file: YAML as above; ``o_y_m`` is the one signal that may be left out.

    Raises:
      MeasurementError: if the extra ``rosbag`` is not installed, or the mapping does not fit the bag.
    """
    path = Path(mapping_file)
    place = show(path)
    mapping = validate(_Mapping, load_yaml(path), place, MeasurementError)
    columns, signals = columns_of(described(mapping.gripper, path.parent, place, "gripper")), mapping.signals
    problem = misfits("key", list(signals), columns.signals[1:], (OBJECT,))
    if problem:
        raise refusal(place, "signals", problem, MeasurementError)
    if mapping.clock not in signals:
        hint = closest(mapping.clock, signals)
        raise refusal(place, "clock", f"{show(mapping.clock)} is no signal{hint}", MeasurementError)
    readings = read_bag(path.parent / mapping.bag, signals)
    grasps = tuple(
        _cut(entry, f"{place}: grasps[{index}]", mapping.clock, readings, columns)
        for index, entry in enumerate(mapping.grasps)
    )
    for index, grasp in enumerate(grasps):
        if grasp.name in [other.name for other in grasps[:index]]:
            raise MeasurementError(f"{place}: grasps[{index}]: {show(grasp.name)} is there twice; rename it")
        check_samples(path, grasp)
    noise = (mapping.position_std_m, mapping.force_std_n)
    fingerprint = fingerprint_of_set(mapping.gripper, *noise, grasps)
    about = (mapping.gripper, mapping.source, mapping.license)
    return MeasurementSet(path, path.stem, *about, *noise, grasps, fingerprint)


def read_bag(path: Path, signals: dict[str, Signal]) -> dict[str, np.ndarray]:
    """Returns for each signal its times, in seconds since the bag's first message, and values, ``(n, 2)``.

    Raises:
      MeasurementError: if the extra ``rosbag`` is not installed, the bag can't be read, or a signal is not in it.
    """
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
            missing = {name: signal.topic for name, signal in signals.items() if signal.topic not in topics}
            if missing:
                lines = [f"{name}: no topic {show(topic)}{closest(topic, topics)}" for name, topic in missing.items()]
                raise MeasurementError(f"{show(path)}: {'; '.join(lines)}")
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
    never = [
        f"{name}: never {show(signals[name].field)} in {signals[name].topic}" for name in readings if not readings[name]
    ]
    if never:
        raise MeasurementError(f"{show(path)}: {'; '.join(never)}")
    return {name: np.array(values) for name, values in readings.items()}


def _value(path: Path, name: str, signal: Signal, message: Any, kind: str) -> float | None:
    try:
        return signal.value(message)
    except (AttributeError, IndexError, TypeError, ValueError) as error:
        fields = [field for field in getattr(message, "__dataclass_fields__", {}) if field != "__msgtype__"]
        raise MeasurementError(
            f"{show(path)}: {name}: no number at {show(signal.field)} of {signal.topic}, a {kind} of"
            f" {', '.join(fields)} ({' '.join(str(error).split())})"
        ) from error


def _cut(entry: _Cut, place: str, clock: str, readings: dict[str, np.ndarray], columns: Columns) -> MeasuredGrasp:
    """One grasp: a sample at each message of the clock, with the newest reading of all other signals."""
    time = readings[clock][:, 0]
    time = time[(time >= entry.start_s) & (time <= entry.end_s)]
    if not len(time):
        ends = readings[clock][[0, -1], 0]
        raise MeasurementError(
            f"{place}.start_s: no message of {clock} until end_s; the bag has some from {ends[0]:g} s"
        )
    cut = {"t_s": time}
    for name, values in readings.items():
        newest = np.searchsorted(values[:, 0], time, side="right") - 1
        if newest[0] < 0:
            raise MeasurementError(f"{place}.start_s: {name} has no reading before {values[0, 0]:g} s; start later")
        cut[name] = values[newest, 1]
    return MeasuredGrasp(
        name=entry.grasp,
        object=entry.object,
        session=entry.session,
        radius_m=entry.object_radius_m,
        offset_m=entry.object_offset_m,
        split=entry.split,
        time_s=time,
        command_m=side_by_side(cut, columns.command),
        position_m=side_by_side(cut, columns.position),
        force_n=side_by_side(cut, columns.force),
        object_m=cut.get(OBJECT),
        columns=columns,
        mass_kg=entry.object_mass_kg,
    )
