"""How many cores, and how much memory, there are for this process: its affinity, and what its container leaves it."""

from __future__ import annotations

import os

import pytest

from forcegrasp import cgroup
from forcegrasp.cores import seen_cores, usable_cores
from forcegrasp.physics.gripper_file import load_gripper
from forcegrasp.physics.plant import Plant


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


@pytest.mark.parametrize(("quota", "cores"), [(None, 3), (8.0, 3), (2.5, 2), (0.5, 1)])
def test_cores_are_those_of_the_affinity_or_fewer_of_the_container(quota, cores, monkeypatch):
    monkeypatch.setattr(os, "sched_getaffinity", lambda process: {0, 4, 5})
    monkeypatch.setattr(cgroup, "cpu_quota", lambda: quota)
    assert (seen_cores(), usable_cores()) == (3, cores)


def test_a_system_without_affinities_tells_how_many_cores_it_has(monkeypatch):
    monkeypatch.delattr(os, "sched_getaffinity")
    monkeypatch.setattr(os, "cpu_count", lambda: None)
    monkeypatch.setattr(cgroup, "cpu_quota", lambda: None)
    assert usable_cores() == 1


def test_the_engine_takes_no_more_threads_than_there_are_cores_for_it(monkeypatch):
    monkeypatch.setattr(cgroup, "cpu_quota", lambda: None)
    gripper = load_gripper("tiago")
    for cores in ({0}, {0, 1, 2}):
        monkeypatch.setattr(os, "sched_getaffinity", lambda process, cores=cores: cores)
        assert Plant(gripper, 4).batch.nthread == len(cores)
    assert Plant(gripper, 4, threads=2).batch.nthread == 2
