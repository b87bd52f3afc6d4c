"""docs/python.md runs, on results made up by hand."""

from __future__ import annotations

from pathlib import Path

import pytest

from forcegrasp.physics.scene_renderer import NoRendererError
from tests.docs.doc_pages import blocks


def test_page_runs(work, capsys):
    names: dict = {"__name__": "__main__"}
    functions, environment, gymnasium = blocks("docs/python.md", "python")
    for block in (functions, environment):
        exec(compile(block.code, "docs/python.md", "exec"), names)
    assert "\nAddResult(<script>" in capsys.readouterr().out
    for file in ("model.yaml", "better.yaml", "runs/why/report.html", "runs/why/diagnosis.json", "runs/why/model.yaml"):
        assert Path(file).is_file()
    assert names["rollout"].batch_size == (64, 10)
    try:
        exec(compile(gymnasium.code, "docs/python.md", "exec"), names)
    except NoRendererError as error:
        pytest.skip(str(error))
    assert names["picture"].shape == (360, 480, 3)
