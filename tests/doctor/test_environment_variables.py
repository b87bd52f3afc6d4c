"""Variables of the environment that do harm, and those that don't."""

from __future__ import annotations

import os

import pytest

from forcegrasp.doctor.environment_variables import check_mujoco_gl, check_python_path


@pytest.mark.parametrize(
    ("value", "system", "level"),
    [
        (None, "linux", "fine"),
        ("egl", "linux", "note"),
        ("OSMesa ", "linux", "note"),
        ("disable", "darwin", "note"),
        ("egl", "darwin", "warning"),
        ("nonsense", "linux", "warning"),
    ],
)
def test_mujoco_gl(value, system, level, told, monkeypatch):
    monkeypatch.setattr("sys.platform", system)
    if value is None:
        monkeypatch.delenv("MUJOCO_GL", raising=False)
    else:
        monkeypatch.setenv("MUJOCO_GL", value)
    line = told(check_mujoco_gl, level)
    assert (value or "not set").strip() in line
    assert ("unset it, or take one of" in line) == (level == "warning")


@pytest.mark.parametrize("name", ["numpy/__init__.py", "yaml.py"])
def test_python_path_hides_a_package(name, told, monkeypatch, tmp_path):
    path = tmp_path / "ros" / name
    path.parent.mkdir(parents=True)
    path.touch()
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path), str(tmp_path / "ros"), ""]))
    line = told(check_python_path, "warning")
    assert f"{name.partition('/')[0].removesuffix('.py')} of {tmp_path / 'ros'} would be imported" in line
    assert line.endswith("unset PYTHONPATH where you run forcegrasp")


def test_harmless_python_path(told, monkeypatch, tmp_path):
    (tmp_path / "numpy").mkdir()  # a folder of data
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    assert "hides nothing" in told(check_python_path, "note")
    monkeypatch.delenv("PYTHONPATH")
    told(check_python_path, "fine")
