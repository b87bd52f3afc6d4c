"""The tool draws what it is asked for, and keeps its tables in the page."""

from __future__ import annotations

import importlib
import re
import subprocess

import pytest


@pytest.fixture
def draw(root, monkeypatch):
    """``draw(*arguments)`` runs the tool in this process."""

    def run(*arguments) -> None:
        monkeypatch.setattr("sys.argv", ["paper_figures.py", *map(str, arguments)])
        importlib.import_module("paper_figures").main()

    monkeypatch.syspath_prepend(root / "tools")
    return run


def test_a_figure_and_its_table(draw, tmp_path):
    page = tmp_path / "page.md"
    page.write_text("before\n<!-- measured: curriculum -->\nnot yet\n<!-- end -->\nafter\n", encoding="utf-8")
    draw("--only", "curriculum", "schematic", "--out", tmp_path / "figures", "--page", page)
    for name in ("curriculum", "schematic"):
        assert (tmp_path / f"figures/paper_{name}.png").read_bytes().startswith(b"\x89PNG")
    text = page.read_text(encoding="utf-8")
    assert "| α₂ | 0 | 1 |" in text
    assert "not yet" not in text
    assert text.startswith("before\n")
    assert text.endswith("after\n")


def test_without_opengl_the_scene_is_left_out(draw, tmp_path, monkeypatch, capsys):
    failed = subprocess.CompletedProcess([], 1, b"", b"")
    monkeypatch.setattr(subprocess, "run", lambda *_, **__: failed)
    draw("--only", "scene", "--out", tmp_path)
    assert not list(tmp_path.iterdir())
    assert "no OpenGL" in capsys.readouterr().out


def test_unknown_figures_are_refused(draw, capsys):
    with pytest.raises(SystemExit) as caught:
        draw("--only", "curriculm")
    assert caught.value.code == 2
    assert "'curriculum'" in capsys.readouterr().err.splitlines()[-1]


def test_page_shows_every_figure_and_table(root):
    page = (root / "docs/calibration.md").read_text(encoding="utf-8")
    for name in re.findall(r"\((figures/\w+\.png)\)", page):
        assert (root / "docs" / name).is_file()
    tables = re.findall(r"<!-- measured: (\w+) -->\n(.*?)<!-- end -->", page, re.DOTALL)
    assert [name for name, _ in tables] == ["act_var", "solimp_var", "fscale_var", "stiffness", "curriculum"]
    assert all(text.count("\n|") >= 4 for _, text in tables)
