"""Columns and keys that are missing, unknown or there twice are told all at once; further columns are skipped."""

from __future__ import annotations

import polars as pl
import pytest
from measured_rig import OPEN_M, refuse

from forcegrasp.measure import check_set, read_set


def rename(path, **new: str) -> None:
    """Gives columns of a CSV file other names; "" takes them out."""
    frame = pl.read_csv(path, infer_schema=False)
    frame.drop([k for k, v in new.items() if not v]).rename({k: v for k, v in new.items() if v}).write_csv(path)


def test_all_wrong_columns_at_once(folder):
    rename(folder / "samples.csv", q_l_m="q_left", f_l_n="F_L_N", t_s="time", qdes_r_m="")
    told = "missing columns: t_s, qdes_r_m, q_l_m, f_l_n; unknown columns: "
    line = refuse(folder, "samples.csv: row 1: ", told, "'F_L_N' (did you mean f_l_n?)", "'time'", "add or rename them")
    assert "'q_left' (did you mean q_l_m?)" in line


def test_all_wrong_columns_of_parquet_at_once(folder, valid_files):
    (folder / "samples.csv").unlink()
    (folder / "samples.parquet").write_bytes(valid_files["samples.parquet"])
    file = folder / "samples.parquet"
    pl.read_parquet(file).drop("q_r_m").rename({"t_s": "t"}).write_parquet(file)
    refuse(folder, "samples.parquet: missing columns: t_s, q_r_m; unknown columns: 't'")


def test_all_wrong_keys_at_once(folder):
    (folder / "meta.yaml").write_text("format: forcegrasp-measurements/1\ngriper: tiago\nlicence: none\nrobot: x\n")
    told = ("griper: unknown; did you mean gripper?", "licence: unknown; did you mean license?", "robot: unknown")
    refuse(folder, "meta.yaml: ", *told, "kind: missing", "gripper: missing")


def test_many_unknown_columns_make_a_short_line(folder):
    rename(folder / "samples.csv", t_s="")
    frame = pl.read_csv(folder / "samples.csv", infer_schema=False)
    frame.with_columns(pl.lit("x").alias(f"a_long_name_of_a_column_{i}") for i in range(40)).write_csv(
        folder / "samples.csv"
    )
    refuse(folder, "missing columns: t_s", "'a_long_name_of_a_column_0'", "32 more")


@pytest.mark.parametrize("samples", ["samples.csv", "samples.parquet"])
def test_further_columns_are_skipped_with_a_note(folder, valid_files, samples):
    plain = read_set(folder)
    if samples == "samples.parquet":
        (folder / "samples.csv").unlink()
        (folder / samples).write_bytes(valid_files[samples])
        frame = pl.read_parquet(folder / samples)
    else:
        frame = pl.read_csv(folder / samples, infer_schema=False)
    odd = pl.Series("motor current", [None, "", "1,5 A", 'a "quoted" word', "\u202e"] * (frame.height // 5))
    frame = frame.insert_column(2, odd).with_columns(pl.lit(0).alias("index"))
    frame.write_csv(folder / samples) if samples.endswith("csv") else frame.write_parquet(folder / samples)
    rename(folder / "grasps.csv", split="person")
    measured = read_set(folder)
    assert [g.split for g in measured.grasps] == [None] * 6
    assert measured.grasps[3].signals()["f_r_n"].tolist() == plain.grasps[3].signals()["f_r_n"].tolist()
    notes = [f"{folder}/grasps.csv: unknown columns are skipped: 'person'"]
    notes += [f"{folder}/{samples}: unknown columns are skipped: 'motor current', 'index'"]
    assert list(measured.notes) == notes
    assert check_set(measured, OPEN_M)[:2] == notes


@pytest.mark.parametrize(
    ("old", "new"), [("split", "splits"), ("object_offset_m", "object_offset"), ("split", "Split ")]
)
def test_a_misspelt_column_is_not_skipped(folder, old, new):
    rename(folder / "grasps.csv", **{old: new})
    refuse(folder, "grasps.csv", f"unknown columns: {new!r} (did you mean {old}?); rename them")


def test_further_columns_of_a_table(folder):
    for name in ("grasps.csv", "samples.csv"):
        (folder / name).unlink()
    (folder / "meta.yaml").write_text("format: forcegrasp-measurements/1\nkind: final_force\ngripper: tiago\n")
    (folder / "table.csv").write_text("object,delta_q_m,final_force_n,day\nfoam,0.001,0.1,monday\n")
    assert read_set(folder).notes == (f"{folder}/table.csv: unknown columns are skipped: 'day'",)
