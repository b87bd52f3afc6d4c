"""A tiny training, which other verbs show and evaluate."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from tests.config.tiny_runs import draw_nothing, trained


@pytest.fixture
def undrawn(monkeypatch) -> None:
    draw_nothing(monkeypatch)


@pytest.fixture(scope="session")
def run_path(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("train") / "run"


@pytest.fixture(scope="session")
def plain_training(run_path) -> dict[str, Any]:
    return trained(run_path)
