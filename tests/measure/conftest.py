"""Valid sets to spoil. They come from a rig of plain numpy, in `measured_rig.py`."""

from __future__ import annotations

from pathlib import Path

import pytest
from measured_rig import make_set, standard_grasps

from forcegrasp.measure import MeasuredGrasp, MeasurementSet, write_set
from forcegrasp.physics.gripper_file import default_gripper


@pytest.fixture(scope="session")
def grasps() -> list[MeasuredGrasp]:
    """The standard grasps, made once."""
    return standard_grasps()


@pytest.fixture(scope="session")
def measured(grasps) -> MeasurementSet:
    """The standard set in memory."""
    return make_set(grasps)


@pytest.fixture(scope="session")
def valid_files(measured, tmp_path_factory) -> dict[str, bytes]:
    """The files of the standard set, CSV and Parquet, and of a table of final forces; by name."""
    root = tmp_path_factory.mktemp("valid")
    write_set(measured, root / "csv")
    write_set(measured, root / "parquet", samples="parquet")
    return {file.name: file.read_bytes() for folder in ("parquet", "csv") for file in (root / folder).iterdir()}


@pytest.fixture
def folder(valid_files, tmp_path) -> Path:
    """A valid set in CSV, free to be spoiled."""
    path = tmp_path / "a set"
    path.mkdir()
    for name in ("meta.yaml", "grasps.csv", "samples.csv"):
        (path / name).write_bytes(valid_files[name])
    return path


@pytest.fixture
def any_gripper(monkeypatch):
    """Every name is that of a gripper like the paper's."""
    gripper = default_gripper()
    monkeypatch.setattr("forcegrasp.physics.gripper_file.load_gripper", lambda name, folder: gripper)
