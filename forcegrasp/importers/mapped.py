"""Any CSV or Parquet file of a servo's log, or any ROS bag, as a map of a few lines says.

```yaml
time: {column: timestamp, unit: ms}            # s, ms, us or ns; default s
joints: [jaw]                                  # {joint} in a column's name stands for each of them
command: {column: "goal_{joint}", unit: deg}   # rad, deg, turns, counts, m, mm or um; N, N·m or V for others
position: {column: "pos_{joint}", unit: counts, per_turn: 4096, sign: -1, offset: 0.1}
effort: {column: "current_{joint}", unit: N·m, scale: 0.0228, signed: false}
enabled: torque_enable                         # whether the motor was switched on
load: external_n                               # a force or torque from outside
recording: run                                 # one recording for each value of this column; default: one per file
```

Of a bag each has a topic, and its column is a field: ``{topic: /joint_states, column: "position[name={joint}]"}``. A
sample is taken at each message of the first joint's position, with the newest of all others; its time is the bag's.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from forcegrasp.errors import MeasurementError
from forcegrasp.importers.column_map import FORCES, Map, Quantity
from forcegrasp.importers.recording import OtherFileError, Recording, files_below
from forcegrasp.importers.tables import Table, parquet_columns, read_columns
from forcegrasp.measure.rosbag import Signal, read_bag

#: Name of the bag's own time stamps among the columns of a table.
_STAMP = ""
_BAGS = (".bag", ".mcap", ".db3")


def find(source: Path) -> list[Path]:
    """Tables and bags at or below a folder, or the file itself."""
    if source.is_file() or (source / "metadata.yaml").is_file():  # a bag of ROS 2 is a folder
        return [source]
    below = [f for f in files_below(source, "*") if f.suffix.lower() in (".csv", ".tsv", ".parquet", *_BAGS)]
    found = [f.parent if (f.parent / "metadata.yaml").is_file() else f for f in below]
    return list(dict.fromkeys(found))


def read_all(place: Path, how: Map) -> Iterator[Recording]:
    """The recordings of a file.

    Raises:
      OtherFileError: if it has none of the columns.
      MeasurementError: if columns are missing, or hold text; all are named.
    """
    is_bag = place.is_dir() or place.suffix in _BAGS
    if is_bag != how.is_of_bag:
        needs = "each column needs a topic in the map" if is_bag else "the map is of a bag"
        raise OtherFileError(f"{place}: is a {'bag' if is_bag else 'table'}: {needs}")
    read = parquet_columns if place.suffix.lower() == ".parquet" else read_columns
    table = _bag(place, how) if is_bag else read(place)
    wanted = how.places()
    run_key = how.recording.key() if how.recording else ""
    _check_columns(place, table, list(wanted), run_key)
    skipped = sorted(set(table.numbers) | set(table.texts)) if not how.is_of_bag else []
    skipped = [name for name in skipped if name and name not in wanted]
    notes = (*table.notes, *([f"skipped: {', '.join(skipped)}"] if skipped else []))
    columns = {name: table.numbers[name] for name in (*wanted, *([_STAMP] if is_bag else [])) if name in table.numbers}
    for run, rows in _runs(table, run_key):
        yield _recording(place.stem + run, {name: values[rows] for name, values in columns.items()}, how, notes)


def _runs(table: Table, key: str) -> Iterator[tuple[str, np.ndarray]]:
    """What each recording's name ends with, and which rows are its own; those that name none are nobody's."""
    if not key:
        yield "", np.ones(table.rows, bool)
        return
    cells = np.array([cell.strip() for cell in table.texts[key]]) if key in table.texts else table.numbers[key]
    for run in dict.fromkeys(cells.tolist()):
        if run != "" and run == run:  # not empty, and not NaN
            yield f"_{run}" if isinstance(run, str) else f"_{run:g}", cells == run


def _check_columns(place: Path, table: Table, wanted: list[str], may_be_text: str) -> None:
    missing = [name for name in wanted if name not in table.numbers and name not in table.texts]
    texts = [table.why_text(name) for name in wanted if name in table.texts and name != may_be_text]
    wrong = [f"no column called {', '.join(missing)}; it has {table.holds()}"] if missing else []
    wrong += [f"no numbers in column {', '.join(texts)}"] if texts else []
    if wrong:
        kind = OtherFileError if len(missing) == len(wanted) else MeasurementError
        raise kind(f"{place}: {'; '.join(wrong)}")


def _recording(name: str, rows: Mapping[str, np.ndarray], how: Map, notes: tuple[str, ...]) -> Recording:
    def values(source: Quantity, unit: str) -> np.ndarray:
        return np.stack([source.si(rows[source.key(joint)], unit) for joint in how.joints], axis=1)

    command, position, effort = how.command, how.position, how.effort
    return Recording(
        name, tuple(how.joints), rows[how.time.key()] * how.time.factor if how.time else rows[_STAMP],
        values(command, command.unit), values(position, position.unit),
        command_unit=FORCES.get(command.unit, ""),
        effort=values(effort, effort.unit) if effort else None, effort_unit=FORCES[effort.unit] if effort else "",
        effort_signed=not effort or effort.signed == "true",
        enabled=rows[how.enabled.key()] if how.enabled else None,
        load=rows[how.load.key()] if how.load else None, notes=notes,
    )  # fmt: skip


def _bag(place: Path, how: Map) -> Table:
    """What the topics of a bag say at each message of the first joint's position."""
    places = how.places()
    signals = {
        key: Signal(topic=place_of.topic or "", field=place_of.name(joint)) for key, (place_of, joint) in places.items()
    }
    readings = read_bag(place, signals)
    stamps = readings[how.position.key(how.joints[0])][:, 0]
    stamps = stamps[stamps >= max(values[0, 0] for values in readings.values())]
    columns = {_STAMP: stamps}
    for key, values in readings.items():
        columns[key] = values[np.searchsorted(values[:, 0], stamps, side="right") - 1, 1]
    return Table(columns)
