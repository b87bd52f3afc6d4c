"""Writes measurement sets in the format that :func:`forcegrasp.measure.read_set` reads, exact to the last bit."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import polars as pl
import yaml

from forcegrasp.errors import MeasurementError
from forcegrasp.files.neighbour import seen_from
from forcegrasp.measure.folder import show
from forcegrasp.measure.samples import check_samples
from forcegrasp.measure.schema import (
    ENABLED,
    FORMAT,
    LOAD,
    TOLERANCES,
    FinalForceTable,
    MeasurementSet,
)


def write_set(measured: MeasurementSet, folder: str | Path, samples: str = "csv") -> Path:
    """Writes a set of grasps into a new or empty folder, and returns the folder.

    Args:
      measured: what to write.
      folder: where to.
      samples: "csv" or "parquet".

    Raises:
      MeasurementError: if the folder is not empty or not writable, or the samples are none.
    """
    if samples not in ("csv", "parquet"):
        raise MeasurementError(f"samples={show(samples)}: must be csv or parquet")
    for grasp in measured.grasps:
        check_samples(measured.path, grasp)
    index = pl.DataFrame(
        [(g.name, g.object, g.session, g.radius_m, g.offset_m, g.mass_kg, g.split) for g in measured.grasps],
        schema={
            "grasp": pl.String,
            "object": pl.String,
            "session": pl.String,
            "object_radius_m": pl.Float64,
            "object_offset_m": pl.Float64,
            "object_mass_kg": pl.Float64,
            "split": pl.String,
        },
        orient="row",
    )
    may_be_empty = ("object_offset_m", "object_mass_kg", "split")
    index = index.drop([name for name in may_be_empty if index[name].null_count() == index.height])
    frame = pl.concat([_frame(grasp.name, grasp.signals()) for grasp in measured.grasps], how="diagonal")
    meta = _meta(measured, "grasps") | {"position_std_m": measured.position_std_m}
    meta |= {key: std for key, (name, usual) in TOLERANCES.items() if (std := float(getattr(measured, name))) != usual}
    write = {"csv": frame.write_csv, "parquet": frame.write_parquet}[samples]
    return _write(folder, meta, {"grasps.csv": index.write_csv, f"samples.{samples}": write})


def write_servo_set(measured: MeasurementSet, folder: str | Path) -> Path:
    """Writes a set of a servo's recordings into a new or empty folder, and returns the folder.

    Raises:
      MeasurementError: if the folder is not empty or not writable, or the samples are none.
    """
    for recording in measured.grasps:
        check_samples(measured.path, recording)
    index = pl.DataFrame([{"recording": r.name, "split": r.split, **r.settings} for r in measured.grasps])
    if index["split"].null_count() == index.height:
        index = index.drop("split")
    frame = pl.concat([_frame(r.name, r.signals(), "recording") for r in measured.grasps], how="diagonal")
    frame = frame.with_columns(
        pl.col(name).fill_null(value) for name, value in _UNDISTURBED.items() if name in frame.columns
    )
    meta = {"format": FORMAT, "kind": "servo", "mechanism": measured.gripper, "source": measured.source}
    meta |= {"license": measured.license, "position_std_m": measured.position_std_m, "effort_std": measured.force_std_n}
    return _write(folder, meta, {"recordings.csv": index.write_csv, "samples.parquet": frame.write_parquet})


def write_table(table: FinalForceTable, folder: str | Path) -> Path:
    """Writes a table of final forces into a new or empty folder, and returns the folder.

    Raises:
      MeasurementError: if the folder is not empty or not writable.
    """
    columns = {"object": table.objects, "delta_q_m": table.delta_q_m, "final_force_n": table.final_force_n}
    if table.sessions:
        columns["session"] = table.sessions
    return _write(folder, _meta(table, "final_force"), {"table.csv": pl.DataFrame(columns).write_csv})


#: Which lines of meta.yaml name a description.
_GRIPPERS = ("gripper", "mechanism")
#: What stands where a recording does not say.
_UNDISTURBED = {ENABLED: 1.0, LOAD: 0.0}


def _frame(name: str, signals: dict[str, np.ndarray], column: str = "grasp") -> pl.DataFrame:
    names = pl.Series(column, [name], dtype=pl.String).new_from_index(0, len(signals["t_s"]))
    return pl.DataFrame([names, *(pl.Series(column, np.asarray(signals[column], float)) for column in signals)])


def _meta(measured: MeasurementSet | FinalForceTable, kind: str) -> dict[str, str | float | None]:
    facts = {name: getattr(measured, name) for name in ("gripper", "source", "license", "force_std_n")}
    return {"format": FORMAT, "kind": kind, **facts}


def _write(folder: str | Path, meta: dict[str, str | float | None], files: dict[str, Callable[[Path], object]]) -> Path:
    folder = Path(folder)
    given = {key: float(value) if isinstance(value, float) else value for key, value in meta.items()}
    given |= {key: seen_from(folder, str(given[key]), folder.resolve().parent) for key in _GRIPPERS if key in given}
    text = yaml.safe_dump({k: v for k, v in given.items() if v is not None}, sort_keys=False, allow_unicode=True)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if any(folder.iterdir()):
            raise MeasurementError(f"{show(folder)}: not empty; choose another folder, or empty it")
        for name, write in files.items():
            write(folder / name)
        (folder / "meta.yaml").write_text(text, encoding="utf-8")  # last: without it this is no set
    except (OSError, pl.exceptions.PolarsError) as error:
        reason = getattr(error, "strerror", None) or str(error).split("\n")[0]
        raise MeasurementError(f"{show(folder)}: can't be written ({reason}); choose another folder") from error
    return folder
