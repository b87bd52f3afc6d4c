"""Quotas, little memory, full disks, folders that can't be written."""

from __future__ import annotations

import shutil
import tempfile
from collections import namedtuple
from pathlib import Path

import pytest

from forcegrasp.doctor import cgroup, machine
from forcegrasp.doctor.machine import check_cores, check_memory, check_runs_folder

Usage = namedtuple("Usage", "total used free")


@pytest.fixture
def groups(tmp_path, monkeypatch):
    """``groups(membership, {file: text})``: control groups of a container, none to begin with."""
    monkeypatch.setattr(cgroup, "MEMBERSHIP", tmp_path / "membership")
    monkeypatch.setattr(cgroup, "GROUPS", tmp_path / "cgroup")

    def write(membership: str, contents: dict[str, str]) -> None:
        (tmp_path / "membership").write_text(membership)
        for name, text in contents.items():
            path = tmp_path / "cgroup" / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text + "\n")

    return write


@pytest.mark.parametrize(
    ("membership", "contents", "quota"),
    [
        ("", {}, None),
        ("0::/", {}, None),
        ("0::/a/b\n", {"a/b/cpu.max": "max 100000", "a/cpu.max": "150000 100000", "cpu.max": "400000 100000"}, 1.5),
        ("0::/\n", {"cpu.max": "max 100000"}, None),
        ("4:cpu,cpuacct:/box\n", {"cpu,cpuacct/box/cpu.cfs_quota_us": "50000"}, None),
        (
            "4:cpu,cpuacct:/box\n",
            {"cpu,cpuacct/box/cpu.cfs_quota_us": "50000", "cpu,cpuacct/box/cpu.cfs_period_us": "100000"},
            0.5,
        ),
        ("1:cpu:/\n0::/\n", {"cpu/cpu.cfs_quota_us": "-1", "cpu/cpu.cfs_period_us": "100000"}, None),
    ],
)
def test_quota(membership, contents, quota, groups):
    groups(membership, contents)
    assert cgroup.cpu_quota() == quota


@pytest.mark.parametrize(
    ("membership", "contents", "left"),
    [
        ("", {}, None),
        ("0::/a\n", {"a/memory.max": "1000", "a/memory.current": "400", "memory.max": "max"}, 600),
        (
            "0::/a\n",  # the group around it has less left
            {"a/memory.max": "1000", "a/memory.current": "400", "memory.max": "900", "memory.current": "800"},
            100,
        ),
        (
            "4:memory:/\n",
            {"memory/memory.limit_in_bytes": "9223372036854771712", "memory/memory.usage_in_bytes": "5"},
            None,
        ),
        ("4:memory:/\n", {"memory/memory.limit_in_bytes": "900", "memory/memory.usage_in_bytes": "5"}, 895),
    ],
)
def test_memory_of_a_container(membership, contents, left, groups):
    groups(membership, contents)
    assert cgroup.memory_left() == left


def test_cores(told, monkeypatch):
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    monkeypatch.setattr(machine, "usable_cores", lambda: 4)
    monkeypatch.setattr(cgroup, "cpu_quota", lambda: None)
    assert " 4, all of which" in told(check_cores, "fine")
    monkeypatch.setattr(cgroup, "cpu_quota", lambda: 2.5)
    assert "may use 2.5 of them" in told(check_cores, "warning")
    assert told(check_cores, "warning").endswith("give physics.threads=2")
    monkeypatch.setattr(cgroup, "cpu_quota", lambda: 0.5)
    assert told(check_cores, "warning").endswith("give physics.threads=1")


@pytest.mark.parametrize(("threads", "level"), [("4", "note"), ("64", "warning"), ("0", "warning"), ("all", "warning")])
def test_openmp(threads, level, monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", threads)
    monkeypatch.setattr(machine, "usable_cores", lambda: 4)
    monkeypatch.setattr(cgroup, "cpu_quota", lambda: None)
    cores, openmp = check_cores()
    assert (cores.level, openmp.level) == ("fine", level)
    assert f"OMP_NUM_THREADS={threads}" in openmp.text
    assert (openmp.remedy == "unset it") == (level == "warning")


def test_memory(told, monkeypatch, tmp_path):
    monkeypatch.setattr(machine, "MEMORY", tmp_path / "meminfo")
    monkeypatch.setattr(cgroup, "memory_left", lambda: None)
    assert "does not tell" in told(check_memory, "note")
    (tmp_path / "meminfo").write_text("MemTotal: 9 kB\nMemAvailable:    8000000 kB\n")
    assert "8.2 GB free" in told(check_memory, "fine")
    monkeypatch.setattr(cgroup, "memory_left", lambda: 500_000_000)
    assert "0.5 GB are free, a training takes about 0.6 GB; close other programs" in told(check_memory, "warning")


@pytest.mark.parametrize(
    ("free", "level", "text"),
    [(5e9, "fine", "5 GB free"), (3e8, "warning", "300 MB are free"), (1e7, "mend", "make room, or go to a folder")],
)
def test_disk(free, level, text, told, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(shutil, "disk_usage", lambda place: Usage(1e12, 1e12 - free, free))
    assert text in told(check_runs_folder, level)
    assert not list(tmp_path.iterdir())


def test_a_folder_that_can_not_be_written(told, monkeypatch, tmp_path):
    def denied(dir: Path):
        raise PermissionError(13, "Permission denied")

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(tempfile, "TemporaryFile", denied)
    line = told(check_runs_folder, "mend")
    assert f"can't be written to {tmp_path} (Permission denied); go to a folder of your own" in line


def test_a_file_in_place_of_the_folder(told, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "runs").touch()
    assert "Not a directory" in told(check_runs_folder, "mend")
