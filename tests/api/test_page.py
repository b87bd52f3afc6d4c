"""docs/python.md and the README's Python run, on results made up by hand."""

from __future__ import annotations

from pathlib import Path

import pytest

from forcegrasp.physics.scene_renderer import NoRendererError
from tests.docs.doc_pages import blocks


@pytest.mark.long
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


def test_python_of_the_readme_runs(work, capsys):
    functions, gymnasium = blocks("README.md", "python")
    names: dict = {"__name__": "__main__"}
    exec(compile(functions.code, "README.md", "exec"), names)
    assert "AddResult(" in capsys.readouterr().out
    assert Path("better.yaml").is_file()
    assert Path("runs/better_fit/report.html").is_file()
    assert names["rollout"]["next", "force"].shape == (64, 150, 2)
    exec(compile(gymnasium.code, "README.md", "exec"), names)
    assert names["env"].observation_space.contains(names["observation"])
