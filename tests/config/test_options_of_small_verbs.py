"""Every option of export and curves changes something. What they write is tested in tests/deploy and tests/evaluate."""

from __future__ import annotations

from typing import Any

import pytest

from forcegrasp.cli.main import main
from forcegrasp.cli.options import leaves
from forcegrasp.config import (
    CurvesConfig,
    ExportConfig,
)
from forcegrasp.errors import ForcegraspError

EXPORT_CASES: dict[str, Any] = {"run": "other", "out": "elsewhere", "gripper": "franka_hand", "ceiling_n": 1.0}
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
