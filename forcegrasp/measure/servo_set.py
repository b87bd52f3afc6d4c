"""Sets of a servo's recordings: ``meta.yaml`` with ``kind: servo``, ``recordings.csv``, and all samples."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import polars as pl
from pydantic import Field

from forcegrasp.errors import MeasurementError
from forcegrasp.files.validate import refusal, validate
from forcegrasp.measure.csv_file import read_csv
from forcegrasp.measure.folder import described, find_file, show
from forcegrasp.measure.joined import check_names, check_splits, read_samples, samples_of_each, side_by_side
from forcegrasp.measure.samples import check_samples
from forcegrasp.measure.schema import (
    ENABLED,
    FORMAT,
    LOAD,
    MeasuredGrasp,
    MeasurementSet,
    columns_of,
    fingerprint_of_set,
)
from forcegrasp.measure.table import FileColumns, Table
from forcegrasp.measure.yaml_file import Name, Positive, Text, TextRecord

if TYPE_CHECKING:
    from forcegrasp.physics.gripper import Gripper

#: What only such a set may hold.
INDEX = "recordings.csv"


class ServoMeta(TextRecord):
    """What meta.yaml says of a set of a servo; no result depends on source and license."""

    format: str = Field(description=FORMAT)
    kind: Name = Field(description="servo")
    mechanism: Name = Field(description="name of one that is shipped, or path of a description")
    source: Text = Field(default="", description="where the data come from")
    license: Text = Field(default="", description="on what terms they may be used")
    position_std_m: Positive | None = Field(default=None, description="noise of the positions, m or rad")
    effort_std: Positive | None = Field(default=None, description="noise of the efforts, N or N·m")


def read_servo_set(folder: Path, content: dict[str, Any]) -> MeasurementSet:
    """Reads a set whose meta.yaml was loaded.

    Raises:
      MeasurementError: if anything is missing, unknown or broken: file, row, column and what to do.
    """
    place = show(folder / "meta.yaml")
    meta = validate(ServoMeta, content, place, MeasurementError)
    mechanism = described(meta.mechanism, folder, place, "mechanism")
    if not mechanism.is_servo:
        raise refusal(
            place, "mechanism", f"{mechanism.name} has fingers; its sets are of kind grasps", MeasurementError
        )
    needed = needed_settings(mechanism)
    optional = ("split", *(name for name in mechanism.settings if name not in needed))
    of_index = FileColumns(("recording", "split"), settings_of(mechanism), optional=optional, blank=("split",))
    index = read_csv(find_file(folder, INDEX), of_index)
    columns = columns_of(mechanism)
    in_samples = FileColumns(("recording",), (*columns.signals, ENABLED, LOAD), optional=(ENABLED, LOAD))
    samples = read_samples(folder, in_samples)
    recordings = _recordings(folder, index, samples, mechanism)
    return MeasurementSet(
        path=folder,
        name=folder.resolve().name,
        gripper=meta.mechanism,
        source=meta.source,
        license=meta.license,
        position_std_m=meta.position_std_m,
        force_std_n=meta.effort_std,
        grasps=recordings,
        fingerprint=fingerprint_of_set(meta.mechanism, meta.position_std_m, meta.effort_std, recordings),
        notes=index.notes() + samples.notes(),
        kind="servo",
    )


def settings_of(mechanism: Gripper) -> tuple[str, ...]:
    """Settings of a mechanism's recordings: those that each must have, and those that the scene takes."""
    return tuple(dict.fromkeys([*needed_settings(mechanism), *mechanism.settings]))


def needed_settings(mechanism: Gripper) -> list[str]:
    """Settings that each recording must have, such as kp: base parameters are multiplied by them."""
    return [p.times for p in mechanism.parameters.values() if p.times]


def _recordings(folder: Path, index: Table, samples: Table, mechanism: Gripper) -> tuple[MeasuredGrasp, ...]:
    check_names(index, "recording")
    check_splits(index)
    parts = samples_of_each(index, samples, "recording")
    found = [_recording(facts, parts[facts["recording"]], mechanism) for facts in index.frame.iter_rows(named=True)]
    for one in found:
        check_samples(folder, one)
    return tuple(found)


def _recording(facts: dict[str, Any], part: pl.DataFrame, mechanism: Gripper) -> MeasuredGrasp:
    columns = columns_of(mechanism)
    return MeasuredGrasp(
        name=facts["recording"],
        object="",
        session=facts["recording"],
        radius_m=None,
        offset_m=None,
        split=facts.get("split") or None,
        time_s=np.array(part["t_s"].to_numpy()),
        command_m=side_by_side(part, columns.command),
        position_m=side_by_side(part, columns.position),
        force_n=side_by_side(part, columns.force),
        object_m=None,
        rows=part["row"].to_numpy().astype(np.int64),
        columns=columns,
        settings={name: float(facts[name]) for name in settings_of(mechanism) if name in facts},
        enabled=part[ENABLED].to_numpy() > 0 if ENABLED in part.columns else None,
        load=np.array(part[LOAD].to_numpy()) if LOAD in part.columns else None,
    )
