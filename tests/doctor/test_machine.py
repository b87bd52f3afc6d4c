"""Quotas, little memory, full disks, folders that can't be written."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections import namedtuple
from pathlib import Path

import pytest

from forcegrasp import cgroup
from forcegrasp.doctor import machine
from forcegrasp.doctor.machine import check_cores, check_memory, check_runs_folder

Usage = namedtuple("Usage", "total used free")


def test_cores(told, monkeypatch):
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    monkeypatch.setattr(os, "sched_getaffinity", lambda process: {0, 1, 2, 3})
    monkeypatch.setattr(cgroup, "cpu_quota", lambda: None)
    assert " 4, all of which" in told(check_cores, "fine")
    monkeypatch.setattr(cgroup, "cpu_quota", lambda: 2.5)
    assert "4 are seen, of which this container may use 2.5; the physics takes 2" in told(check_cores, "fine")


@pytest.mark.parametrize(("threads", "level"), [("4", "note"), ("64", "warning"), ("0", "warning"), ("all", "warning")])
def test_openmp(threads, level, monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", threads)
    monkeypatch.setattr(os, "sched_getaffinity", lambda process: {0, 1, 2, 3})
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
