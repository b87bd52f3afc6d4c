"""What was written is read, to the last bit; the fingerprint follows the content and nothing else."""

from __future__ import annotations

import re
import subprocess
import sys
from dataclasses import replace

import numpy as np
import polars as pl
import pytest
import yaml
from measured_rig import change, edit, make_set

from forcegrasp.errors import ForcegraspError, MeasurementError
from forcegrasp.measure import FinalForceTable, MeasurementSet, read_set, write_set, write_table
from forcegrasp.measure.schema import OBJECT, TOLERANCES, TWO_FINGERS, fingerprint_of_set, fingerprint_of_table


def _same(a: MeasurementSet, b: MeasurementSet) -> None:
    for name in ("gripper", "source", "license", "position_std_m", "force_std_n", "fingerprint"):
        assert getattr(a, name) == getattr(b, name)
    for name, _ in TOLERANCES.values():
        assert getattr(a, name) == getattr(b, name)
    for one, two in zip(a.grasps, b.grasps, strict=True):
        for name in ("name", "object", "session", "radius_m", "offset_m", "mass_kg", "split"):
            assert getattr(one, name) == getattr(two, name)
        for name, values in one.signals().items():
            np.testing.assert_array_equal(values.view(np.int64), two.signals()[name].view(np.int64), name)
        assert (one.object_m is None) == (two.object_m is None)


@pytest.mark.parametrize("samples", ["csv", "parquet"])
def test_round_trip(measured, tmp_path, samples):
    _same(measured, read_set(write_set(measured, tmp_path / "new" / "set", samples)))
    assert read_set(tmp_path / "new" / "set").name == "set"


@pytest.mark.parametrize("samples", ["csv", "parquet"])
def test_every_float(grasps, tmp_path, samples):
    draw = np.random.default_rng(0)
    bits = draw.integers(0, 2**64, 4000, dtype=np.uint64).view(np.float64)
    bits[:6] = 0.0, -0.0, 5e-324, np.finfo(float).max, 0.1, 1 / 3
    bits = np.where(np.isfinite(bits), bits, 0.1)[: len(bits) // 2 * 2].reshape(-1, 2)
    time = np.cumsum(draw.uniform(1e-6, 1, len(bits))) + 1.7e9
    wild = change(grasps[0], time_s=time, command_m=bits, position_m=-bits, force_n=bits[::-1], object_m=bits[:, 0])
    _same(make_set([wild]), read_set(write_set(make_set([wild]), tmp_path / "set", samples)))


@pytest.mark.parametrize("samples", ["csv", "parquet"])
@pytest.mark.parametrize(
    "changes",
    [
        {"radius_m": None},
        {"offset_m": None},
        {"mass_kg": 0.25},
        {"split": None},
        {"radius_m": None, "offset_m": None, "split": None},
        {"object_m": None},
        {"name": 'a "quoted", name; with 90 % of ümläuts 漢字'},
        {"object": "cup, red", "session": "2026-11-20 #3"},
        {"name": "007"},
        {"name": "nan"},
        {"name": "null"},
        {"object": "~"},
        {"name": "x" * 100},
    ],
    ids=str,
)
def test_what_is_not_given(grasps, tmp_path, samples, changes):
    for changed in ([change(grasps[0], **changes), *grasps[1:]], [change(grasps[0], **changes)]):
        folder = tmp_path / f"set{len(changed)}"
        _same(make_set(changed), read_set(write_set(make_set(changed), folder, samples)))


@pytest.mark.parametrize(
    "changes",
    [
        {"position_std_m": None, "force_std_n": None},
        {"gripper": "yes"},
        {"gripper": "0x10", "source": "no", "license": "1.10"},
        {"source": "two\nlines: with a colon\nand # more", "license": "© ümläut 漢字"},
        {"source": "- a list?", "license": "{not: a mapping}"},
        {"source": "&anchor *alias !tag", "license": "| >"},
        {"force_std_n": 1e-5, "position_std_m": 5e-324},
    ],
    ids=str,
)
def test_meta(grasps, tmp_path, changes, any_gripper):
    _same(make_set(grasps, **changes), read_set(write_set(make_set(grasps, **changes), tmp_path / "set")))


@pytest.mark.parametrize("key", TOLERANCES)
def test_tolerances(measured, tmp_path, key):
    """What is usual is not written; what is not is kept, and another set by its fingerprint."""
    name, usual = TOLERANCES[key]
    assert getattr(read_set(write_set(measured, tmp_path / "usual")), name) == usual
    assert key not in (tmp_path / "usual" / "meta.yaml").read_text()
    facts = (measured.gripper, measured.position_std_m, measured.force_std_n, measured.grasps)
    other = replace(measured, **{name: 3 * usual}, fingerprint=fingerprint_of_set(*facts, {key: 3 * usual}))
    _same(other, read_set(write_set(other, tmp_path / "other")))
    assert other.fingerprint != measured.fingerprint


def test_fingerprint_of_every_format(folder, measured, valid_files):
    assert re.fullmatch("[0-9a-f]{64}", measured.fingerprint)
    header, *rows = (folder / "samples.csv").read_text().strip().split("\n")
    _, *index = (folder / "grasps.csv").read_text().strip().split("\n")
    top = (folder / "grasps.csv").read_text().split("\n")[0]
    mixed = [row for rank in range(100) for row in rows[rank::100]]
    order = header.split(",")[::-1]
    swapped = [",".join(row.split(",")[::-1]) for row in rows]
    variants = {
        "grasps.csv": [
            "\n".join([top, *index[::-1]]),
            "\n".join([top, *index]),  # no newline at the end
            "\r\n".join([top, *index, ""]),
            "\ufeff" + "\n".join([top, *index, "", "", ""]),
        ],
        "samples.csv": [
            "\n".join([header, *mixed]),
            "\r\n".join([header, *rows]) + "\r\n\r\n",
            "\n".join([",".join(order), *swapped]),
            "\ufeff" + "\n".join([header, *rows]),
            "\n".join([header, *(",".join(f'"{cell}"' for cell in row.split(",")) for row in rows)]),
            "\n".join([header, *(row.replace(",", ", ").replace(", ", ",", 1) for row in rows)]),
        ],
        "meta.yaml": ["# a comment\n" + (folder / "meta.yaml").read_text().replace("numpy", "another source")],
    }
    for file, texts in variants.items():
        for text in texts:
            (folder / file).write_text(text, newline="")
            assert read_set(folder).fingerprint == measured.fingerprint, text[:300]
        (folder / file).write_bytes(valid_files[file])
    frame = pl.read_csv(folder / "samples.csv")
    (folder / "samples.csv").unlink()
    for spoilt in (frame, frame.with_columns(pl.col("grasp").cast(pl.Categorical)), frame.sample(fraction=1.0, seed=0)):
        if spoilt.height and spoilt["grasp"].dtype == pl.String and not spoilt["t_s"].equals(frame["t_s"]):
            spoilt = spoilt.sort("t_s", maintain_order=True)
        spoilt.write_parquet(folder / "samples.parquet")
        assert read_set(folder).fingerprint == measured.fingerprint


def test_masses_are_another_set_and_are_not_written_where_none_is_given(measured, folder, tmp_path):
    assert "object_mass_kg" not in (folder / "grasps.csv").read_text()
    heavy = make_set([change(grasp, mass_kg=0.2 + 0.1 * i) for i, grasp in enumerate(measured.grasps)])
    assert "object_mass_kg" in (write_set(heavy, tmp_path / "heavy") / "grasps.csv").read_text()
    assert heavy.fingerprint != measured.fingerprint


def test_fingerprint_follows_every_number(measured, folder, any_gripper):
    seen = {measured.fingerprint}
    edits = [("samples.csv", 44, name, "0.01234") for name in (*TWO_FINGERS.signals[1:], OBJECT)]
    edits += [("samples.csv", 44, "t_s", "1.6801")]
    edits += [("grasps.csv", 3, name, "0.0111") for name in ("object_radius_m", "object_offset_m")]
    edits += [("grasps.csv", 3, name, "another") for name in ("object", "session")]
    edits += [("grasps.csv", 3, "split", ""), ("grasps.csv", 3, "object_offset_m", "")]
    for file, row, column, cell in edits:
        text = (folder / file).read_text()
        edit(folder / file, row, column, cell)
        seen.add(read_set(folder).fingerprint)
        (folder / file).write_text(text)
    for name, value in (("gripper", "other"), ("force_std_n", "0.5"), ("position_std_m", "1e-3")):
        text = (folder / "meta.yaml").read_text()
        facts = yaml.safe_load(text) | {name: value}
        (folder / "meta.yaml").write_text("".join(f"{key}: {fact}\n" for key, fact in facts.items()))
        seen.add(read_set(folder).fingerprint)
        (folder / "meta.yaml").write_text(text)
    assert len(seen) == 1 + len(edits) + 3
    assert read_set(folder).fingerprint == measured.fingerprint


def test_whole_numbers_for_names(folder, valid_files):
    for file in ("grasps.csv", "samples.csv"):
        text = (folder / file).read_text()
        (folder / file).write_text(re.sub(r"^g(\d)", r"\1", text, flags=re.MULTILINE))
    from_csv = read_set(folder)
    assert from_csv.grasps[2].name == "2"
    frame = pl.read_csv(folder / "samples.csv")
    assert frame["grasp"].dtype == pl.Int64
    (folder / "samples.csv").unlink()
    single = pl.col("qdes_l_m").cast(pl.Float32).cast(pl.Float64)
    frame.write_parquet(folder / "samples.parquet")
    assert read_set(folder).fingerprint == from_csv.fingerprint
    frame.with_columns(single.cast(pl.Float32)).write_parquet(folder / "samples.parquet")
    narrow = read_set(folder).fingerprint
    frame.with_columns(single).write_parquet(folder / "samples.parquet")
    assert read_set(folder).fingerprint == narrow != from_csv.fingerprint


@pytest.mark.parametrize("samples", ["csv", "parquet"])
def test_rows_are_known(measured, tmp_path, samples):
    grasps = read_set(write_set(measured, tmp_path / "set", samples)).grasps
    first = 2 if samples == "csv" else 1
    np.testing.assert_array_equal(np.concatenate([grasp.rows for grasp in grasps]), first + np.arange(600))


def test_full_folder_is_left_alone(measured, tmp_path):
    (tmp_path / "mine").write_text("x")
    with pytest.raises(MeasurementError, match="not empty"):
        write_set(measured, tmp_path)
    assert [file.name for file in tmp_path.iterdir()] == ["mine"]
    with pytest.raises(MeasurementError, match="can't be written"):
        write_set(measured, tmp_path / "mine")
    with pytest.raises(MeasurementError, match="can't be written"):
        write_set(measured, tmp_path / "mine" / "below")
    with pytest.raises(MeasurementError, match="csv or parquet"):
        write_set(measured, tmp_path / "set", "xlsx")


def test_nothing_broken_is_written(measured, grasps, tmp_path):
    for spoilt in ({"force_n": np.full((100, 2), np.nan)}, {"time_s": np.zeros(100)}):
        with pytest.raises(MeasurementError):
            write_set(replace(measured, grasps=(change(grasps[0], **spoilt),)), tmp_path / "set")
        assert not (tmp_path / "set").exists()


def _table(path, objects=("sponge", "wood", "cup, red"), force_std_n=0.01) -> FinalForceTable:
    delta, force = np.array([3e-4, 1 / 3e3, 9e-4]), np.array([0.0, 0.1, -0.015])
    digest = fingerprint_of_table("tiago", force_std_n, objects, delta, force)
    return FinalForceTable(path, "t", "tiago", "paper", "CC-BY", force_std_n, objects, delta, force, digest)


@pytest.mark.parametrize("std", [None, 0.01])
def test_table(tmp_path, std):
    table = _table(tmp_path, force_std_n=std)
    read = read_set(write_table(table, tmp_path / "t"))
    assert isinstance(read, FinalForceTable)
    for name in ("name", "gripper", "source", "license", "force_std_n", "objects", "fingerprint"):
        assert getattr(read, name) == getattr(table, name)
    np.testing.assert_array_equal(read.delta_q_m, table.delta_q_m)
    np.testing.assert_array_equal(read.final_force_n, table.final_force_n)
    header, *rows = (tmp_path / "t" / "table.csv").read_text().strip().split("\n")
    (tmp_path / "t" / "table.csv").write_text("\n".join([header, *rows[::-1]]))
    assert read_set(tmp_path / "t").fingerprint == table.fingerprint


@pytest.mark.parametrize("cell", ["", "abc", "nan", "inf", "1,5", "1e999"])
@pytest.mark.parametrize("column", ["object", "delta_q_m", "final_force_n"])
def test_cell_of_a_table(tmp_path, column, cell):
    folder = write_table(_table(tmp_path), tmp_path / "t")
    edit(folder / "table.csv", 3, column, cell)
    if column == "object" and cell not in ("", "1,5"):
        assert read_set(folder).objects[1] == cell
        return
    with pytest.raises(MeasurementError, match=r"table\.csv: row 3"):
        read_set(folder)


def test_errors_are_ours():
    assert issubclass(MeasurementError, ForcegraspError)


def test_measure_works_without_torch_or_rosbags():
    program = """
import sys
for name in ("torch", "torchrl", "tensordict", "rosbags", "mujoco"):
    sys.modules[name] = None  # importing it raises
import forcegrasp.measure
"""
    subprocess.run([sys.executable, "-c", program], check=True)
