"""Folders with files that are missing, too many, elsewhere, too large, or no files at all."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest
from measured_rig import refuse

from forcegrasp.errors import MeasurementError
from forcegrasp.measure import read_set

FILES = ("meta.yaml", "grasps.csv", "samples.csv")


@pytest.mark.parametrize("path", ["nowhere", "no/where", "a\nb", "x" * 300, "\0", "~", ""])
def test_no_folder(tmp_path, path):
    with pytest.raises(MeasurementError) as caught:
        read_set(str(tmp_path / "none" / path) if path else "")
    assert str(caught.value).isprintable()


@pytest.mark.parametrize("file", FILES)
def test_file_for_a_folder(folder, file):
    refuse(folder / file, "not a folder")


@pytest.mark.parametrize("file", FILES)
def test_missing(folder, file):
    (folder / file).unlink()
    refuse(folder, file, "missing")


@pytest.mark.parametrize(("table", "kind"), [(False, "grasps"), (True, "final_force")])
def test_a_first_meta_yaml_is_offered(folder, table, kind):
    """The command in the message writes one that can be read."""
    (folder / "meta.yaml").unlink()
    if table:
        (folder / "grasps.csv").unlink()
        (folder / "samples.csv").unlink()
        (folder / "table.csv").write_text("object,delta_q_m,final_force_n\nfoam,0.001,0.1\n")
    command = refuse(folder, "meta.yaml: missing; write it").partition("gripper: printf")[2]
    subprocess.run(f"printf {command}", shell=True, check=True)
    assert kind in (folder / "meta.yaml").read_text()
    assert read_set(folder).gripper == "tiago"


@pytest.mark.parametrize("file", FILES)
@pytest.mark.parametrize("ending", [".gz", ".txt", " ", "~", ".zip"])
def test_another_ending(folder, file, ending):
    (folder / file).rename(folder / f"{file}{ending}")
    refuse(folder, file, "missing", "rename")


@pytest.mark.parametrize("file", FILES)
def test_capitals(folder, file):
    (folder / file).rename(folder / file.title())
    refuse(folder, file, "missing", file.title())


@pytest.mark.parametrize("file", FILES)
def test_folder_for_a_file(folder, file):
    (folder / file).unlink()
    (folder / file).mkdir()
    refuse(folder, file, "not an ordinary file")


@pytest.mark.parametrize("file", FILES)
def test_pipe(folder, file):
    (folder / file).unlink()
    os.mkfifo(folder / file)
    refuse(folder, file, "not an ordinary file")


@pytest.mark.parametrize("file", FILES)
@pytest.mark.parametrize("target", ["/dev/zero", "/etc/passwd", "../outside", "loop", "gone"])
def test_link(folder, file, target):
    shutil.copy(folder / file, folder.parent / "outside")
    (folder / file).unlink()
    if target == "loop":
        (folder / "loop").symlink_to(file)
    (folder / file).symlink_to(target)
    refuse(folder, file)


@pytest.mark.parametrize("file", FILES)
def test_unreadable(folder, file, monkeypatch):
    def refuse_to_open(path, *args, **options):
        raise PermissionError(13, "Permission denied")

    read_set(folder)
    monkeypatch.setattr("builtins.open", refuse_to_open)
    refuse(folder, "Permission denied")


@pytest.mark.parametrize("file", FILES)
def test_larger_than_2_gb(folder, file):
    with open(folder / file, "r+b") as sparse:
        sparse.truncate(3_000_000_000)
    refuse(folder, file, "too large")


def test_too_many_rows(folder, monkeypatch):
    monkeypatch.setattr("forcegrasp.measure.csv_file.MAX_ROWS", 599)
    refuse(folder, "samples.csv", "599 rows")
    monkeypatch.setattr("forcegrasp.measure.csv_file.MAX_ROWS", 600)
    read_set(folder)


def test_csv_and_parquet(folder, valid_files):
    (folder / "samples.parquet").write_bytes(valid_files["samples.parquet"])
    refuse(folder, "samples.csv and samples.parquet")


def test_table_among_grasps(folder):
    (folder / "table.csv").write_text("object,delta_q_m,final_force_n\n")
    refuse(folder, "table.csv", "kind grasps")


@pytest.mark.parametrize("file", ["grasps.csv", "samples.csv", "samples.parquet"])
def test_grasps_in_a_set_of_final_forces(folder, file):
    meta = folder / "meta.yaml"
    text = "\n".join(line for line in meta.read_text().split("\n") if "position_std" not in line)
    meta.write_text(text.replace("kind: grasps", "kind: final_force"))
    for name in ("grasps.csv", "samples.csv"):
        (folder / name).unlink()
    (folder / file).write_text("")
    refuse(folder, file, "kind final_force")


def test_empty_folder(tmp_path):
    refuse(tmp_path, "meta.yaml", "missing")


def test_name_with_a_line_break(folder):
    odd = folder.rename(folder.parent / "two\nlines")
    (odd / "grasps.csv").unlink()
    with pytest.raises(MeasurementError) as caught:
        read_set(odd)
    assert str(caught.value).isprintable()


def test_link_within_the_folder(folder):
    (folder / "samples.csv").rename(folder / "monday.csv")
    (folder / "samples.csv").symlink_to("monday.csv")
    assert len(read_set(folder).grasps) == 6


def test_link_to_the_folder(folder, tmp_path):
    (tmp_path / "link").symlink_to(folder)
    assert read_set(Path(tmp_path / "link")).name == folder.name
