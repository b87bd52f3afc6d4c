"""Every option of export, curves and robot changes something. What they write is tested where it is made."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from forcegrasp.cli.main import main
from forcegrasp.cli.options import leaves
from forcegrasp.config import (
    CurvesConfig,
    ExportConfig,
    RobotConfig,
)
from forcegrasp.errors import ForcegraspError

EXPORT_CASES: dict[str, Any] = {"run": "other", "out": "elsewhere", "gripper": "franka_hand", "ceiling_n": 1.0}
ROBOT_CASES: dict[str, Any] = {"number": 7, "gripper": "franka_hand", "out": "other.yaml"}
CURVES_CASES: dict[str, Any] = {"folders": "[other]", "out": "elsewhere"}


def exporting(monkeypatch, **values: Any) -> tuple:
    """What the verb sets out to export, where to, with which ceiling, and of which gripper."""
    asked = []

    def stop(*arguments):
        asked.extend(arguments)
        raise ForcegraspError("enough")

    monkeypatch.setattr("forcegrasp.runs.export.export_policy", stop)
    monkeypatch.setattr("time.strftime", lambda *_: "NOW")
    assert main(["export", *(f"{name}={value}" for name, value in ({"run": "one"} | values).items())]) == 2
    return tuple(asked)


def test_every_option_of_export_has_a_case():
    assert list(EXPORT_CASES) == [name for name, *_ in leaves(ExportConfig)]


@pytest.mark.parametrize("name", EXPORT_CASES)
def test_option_of_export(name, monkeypatch):
    plain = exporting(monkeypatch)
    assert exporting(monkeypatch) == plain != exporting(monkeypatch, **{name: EXPORT_CASES[name]})


def test_every_option_of_curves_has_a_case():
    assert list(CURVES_CASES) == [name for name, *_ in leaves(CurvesConfig)]


def with_curves(monkeypatch, **values: str) -> list:
    """Which folders are read, and where the curves would be written."""
    asked = []
    monkeypatch.setattr("forcegrasp.evaluate.curves.learning_curves", lambda *arguments: asked.extend(arguments))
    assert main(["curves", *(f"{name}={value}" for name, value in ({"folders": "[one,two]"} | values).items())]) == 0
    return asked


@pytest.mark.parametrize("name", CURVES_CASES)
def test_option_of_curves(name, monkeypatch):
    plain = with_curves(monkeypatch)
    assert with_curves(monkeypatch) == plain != with_curves(monkeypatch, **{name: CURVES_CASES[name]})


def test_every_option_of_robot_has_a_case():
    assert list(ROBOT_CASES) == [name for name, *_ in leaves(RobotConfig)]


def written_robot(folder: Path, monkeypatch, **values: Any) -> dict[str, str]:
    """Files that the verb writes."""
    folder.mkdir()
    monkeypatch.chdir(folder)
    assert main(["robot", *(f"{name}={value}" for name, value in values.items())]) == 0
    return {path.name: path.read_text("utf-8") for path in folder.iterdir()}


@pytest.mark.parametrize("name", ROBOT_CASES)
def test_option_of_robot(name, tmp_path, monkeypatch):
    plain, again = (written_robot(tmp_path / folder, monkeypatch) for folder in ("plain", "again"))
    assert written_robot(tmp_path / "changed", monkeypatch, **{name: ROBOT_CASES[name]}) != plain == again
