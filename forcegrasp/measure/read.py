"""Reads a measurement set from its folder, or says in one line why it can't."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import numpy as np
import polars as pl
from pydantic import Field

from forcegrasp.errors import MeasurementError, closest
from forcegrasp.files.validate import must, refusal, validate
from forcegrasp.measure.csv_file import read_csv
from forcegrasp.measure.folder import described, find_file, open_folder, show
from forcegrasp.measure.joined import check_names, check_splits, read_samples, samples_of_each, side_by_side
from forcegrasp.measure.samples import check_samples
from forcegrasp.measure.schema import (
    DELAY_STD_S,
    FORMAT,
    OBJECT,
    OFFSET_STD_M,
    PERIOD_STD_SHARE,
    RADIUS_STD_M,
    TOLERANCES,
    Columns,
    FinalForceTable,
    MeasuredGrasp,
    MeasurementSet,
    columns_of,
    fingerprint_of_set,
    fingerprint_of_table,
)
from forcegrasp.measure.servo_set import read_servo_set
from forcegrasp.measure.table import FileColumns, Table
from forcegrasp.measure.yaml_file import Name, Positive, Text, TextRecord, load_yaml

_Share = Annotated[
    Positive, must(lambda value: value < 0.1, "{:g} is no share that a clock is off by; 0.01 is one percent")
]
_Short = Annotated[
    Positive, must(lambda value: value < 0.5, "{:g} s is too long; looks like milliseconds, divide by 1000")
]


class Meta(TextRecord):
    """What meta.yaml says of a set; no result depends on source and license."""

    format: str = Field(description=FORMAT)
    kind: Name = Field(description="grasps or final_force; sets of a servo have keys of their own")
    gripper: Name = Field(description="name of one that is shipped, or path of a description")
    source: Text = Field(default="", description="where the data come from")
    license: Text = Field(default="", description="on what terms they may be used")
    position_std_m: Positive | None = Field(default=None, description="noise of the positions, m or rad")
    force_std_n: Positive | None = Field(default=None, description="noise of the forces, N")
    object_radius_std_m: Positive = Field(default=RADIUS_STD_M, description="standard deviation of the radii, m")
    object_offset_std_m: Positive = Field(default=OFFSET_STD_M, description="that of the objects' places, m")
    period_std_share: _Share = Field(default=PERIOD_STD_SHARE, description="that of the clock's rate, a share of it")
    delay_std_s: _Short = Field(default=DELAY_STD_S, description="that of the time from a command to its readings, s")


_GRASPS = FileColumns(
    text=("grasp", "object", "session", "split"),
    numbers=("object_radius_m", "object_offset_m", "object_mass_kg"),
    optional=("object_offset_m", "object_mass_kg", "split"),
    blank=("object_radius_m", "object_offset_m", "object_mass_kg", "split"),
)
_FINAL = FileColumns(text=("object", "session"), numbers=("delta_q_m", "final_force_n"), optional=("session",))


def read_set(path: str | Path) -> MeasurementSet | FinalForceTable:
    """Returns the measurement set in a folder.

    Raises:
      MeasurementError: if anything is missing, unknown, broken, or too large: file, row, column and what to do.
    """
    folder = open_folder(path)
    file = find_file(folder, "meta.yaml")
    content = load_yaml(file)
    if content.get("format") != FORMAT:  # first, lest the keys of another format are called unknown
        raise MeasurementError(f"{show(file)}: format: must be {FORMAT}, not {show(content.get('format', ''))}")
    if content.get("kind") == "servo":
        _refuse_files(folder, "servo", ("grasps.csv", "table.csv"))
        return read_servo_set(folder, content)
    meta = validate(Meta, content, show(file), MeasurementError)
    readers = {"grasps": _read_grasps, "final_force": _read_table}
    if meta.kind not in readers:
        problem = f"{show(meta.kind)} is unknown{closest(meta.kind, [*readers, 'servo'])}"
        raise refusal(show(file), "kind", problem, MeasurementError)
    facts = {"path": folder, "name": folder.resolve().name}
    return readers[meta.kind](
        folder, meta, facts | meta.model_dump(include={"gripper", "source", "license", "force_std_n"})
    )


def _read_table(folder: Path, meta: Meta, facts: dict[str, Any]) -> FinalForceTable:
    if meta.position_std_m is not None:
        problem = "a table of final forces has no positions; remove it"
        raise refusal(show(folder / "meta.yaml"), "position_std_m", problem, MeasurementError)
    for key in sorted(meta.model_fields_set & set(TOLERANCES)):
        problem = "a table of final forces has no radii, places or times; remove it"
        raise refusal(show(folder / "meta.yaml"), key, problem, MeasurementError)
    _refuse_files(folder, "final_force", ("grasps.csv", "samples.csv", "samples.parquet"))
    rows = read_csv(find_file(folder, "table.csv"), _FINAL)
    objects = tuple(rows.frame["object"].to_list())
    delta, force = (np.array(rows.frame[name].to_numpy()) for name in _FINAL.numbers)
    sessions = tuple(rows.frame["session"].to_list()) if "session" in rows.frame.columns else ()
    fingerprint = fingerprint_of_table(meta.gripper, meta.force_std_n, objects, delta, force, sessions)
    readings = {"objects": objects, "delta_q_m": delta, "final_force_n": force, "sessions": sessions}
    return FinalForceTable(**facts, **readings, fingerprint=fingerprint, notes=rows.notes())


def _read_grasps(folder: Path, meta: Meta, facts: dict[str, Any]) -> MeasurementSet:
    _refuse_files(folder, "grasps", ("table.csv",))
    columns = columns_of(described(meta.gripper, folder, show(folder / "meta.yaml"), "gripper"))
    in_samples = FileColumns(("grasp",), (*columns.signals, OBJECT), optional=(OBJECT,), blank=(OBJECT,))
    table = read_csv(find_file(folder, "grasps.csv"), _GRASPS)
    _check_grasps(table)
    samples = read_samples(folder, in_samples)
    grasps = _grasps(folder, table, samples, columns)
    tolerances: dict[str, float] = meta.model_dump(include=set(TOLERANCES))
    stds: dict[str, Any] = {name: tolerances[key] for key, (name, _) in TOLERANCES.items()}
    return MeasurementSet(
        **facts,
        position_std_m=meta.position_std_m,
        **stds,
        grasps=grasps,
        fingerprint=fingerprint_of_set(meta.gripper, meta.position_std_m, meta.force_std_n, grasps, tolerances),
        notes=table.notes() + samples.notes(),
    )


def _refuse_files(folder: Path, kind: str, names: tuple[str, ...]) -> None:
    for name in names:
        if (folder / name).exists():
            raise MeasurementError(
                f"{show(folder / name)}: does not belong to kind {kind}; remove it, or correct kind in meta.yaml"
            )


def _check_grasps(table: Table) -> None:
    """Raises MeasurementError about a name that is there twice, a size that is none, or an unknown split."""
    frame = table.frame
    check_names(table, "grasp")
    for column in ("object_radius_m", "object_mass_kg"):
        for index, size in enumerate(frame[column] if column in frame.columns else ()):
            if size is not None and size <= 0:
                raise table.refuse(index, column, f"{size:g} must be positive; leave it empty if not known")
    check_splits(table)


def _grasps(folder: Path, table: Table, samples: Table, columns: Columns) -> tuple[MeasuredGrasp, ...]:
    """Joins the rows of grasps.csv with their samples, which may be interleaved."""
    parts = samples_of_each(table, samples, "grasp")
    rows = table.frame.iter_rows(named=True)
    grasps = tuple(_grasp(samples, facts, parts[facts["grasp"]], columns) for facts in rows)
    for grasp in grasps:
        check_samples(folder, grasp)
    return grasps


def _grasp(samples: Table, facts: dict[str, Any], part: pl.DataFrame, columns: Columns) -> MeasuredGrasp:
    seen = None
    if OBJECT in part.columns and part[OBJECT].null_count() < part.height:
        empty = part[OBJECT].is_null()
        if empty.any():
            index = int(part["row"][int(empty.to_numpy().argmax())]) - samples.first_row
            raise samples.refuse(index, OBJECT, "is empty, though not in all of this grasp; fill or empty all its rows")
        seen = np.array(part[OBJECT].to_numpy())
    return MeasuredGrasp(
        name=facts["grasp"],
        object=facts["object"],
        session=facts["session"],
        radius_m=facts["object_radius_m"],
        offset_m=facts.get("object_offset_m"),
        split=facts.get("split") or None,
        time_s=np.array(part["t_s"].to_numpy()),
        command_m=side_by_side(part, columns.command),
        position_m=side_by_side(part, columns.position),
        force_n=side_by_side(part, columns.force),
        object_m=seen,
        rows=part["row"].to_numpy().astype(np.int64),
        columns=columns,
        mass_kg=facts.get("object_mass_kg"),
    )
