"""docs/tutorial.md runs from top to bottom and prints what it shows; the notebook is the page."""

from __future__ import annotations

import json
import re
import runpy

import pytest
from doc_pages import PAGES, blocks

PAGE = PAGES["docs/tutorial.md"]
_NUMBER = re.compile(r"\d+(?:\.\d+)?")
#: Of a number that is printed: machines round differently, and a fit ends a little elsewhere.
NEAR = {"rel": 0.2, "abs": 0.2}


@pytest.fixture(scope="module")
def tool(root) -> dict:
    return runpy.run_path(str(root / "tools" / "tutorial_notebook.py"))


@pytest.mark.long
def test_page_runs_and_says_what_it_shows(tool, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    outputs = tool["execute"](PAGE)
    printed = [output.printed for output in outputs if output.printed]
    shown = [block.code for block in blocks("docs/tutorial.md", "text")]
    assert [_NUMBER.sub("#", text) for text in printed] == [_NUMBER.sub("#", text) for text in shown]
    for one, other in zip(printed, shown, strict=True):
        assert numbers(one) == pytest.approx(numbers(other), **NEAR)
    pictures = [output.pictures for output in outputs]
    assert sum(map(len, pictures)) == PAGE.count("](figures/tutorial_")
    (tmp_path / "figures").mkdir()
    again = tool["fill"](PAGE, outputs, tmp_path)
    assert _NUMBER.sub("#", again) == _NUMBER.sub("#", PAGE)
    assert not any(path.suffix != ".png" for path in tmp_path.rglob("*.*")), "writes into the reader's folder"


def numbers(text: str) -> list[float]:
    return [float(number) for number in _NUMBER.findall(text)]


def test_page_finds_what_was_hidden():
    assert 'parse_effect("force_lag' in PAGE
    assert "\neffect: force_lag\n" in PAGE


def test_notebook_is_the_page(tool, root):
    content = json.loads((root / "docs" / "tutorial.ipynb").read_text("utf-8"))
    assert content == tool["notebook"](PAGE, root / "docs"), "python tools/tutorial_notebook.py"
    code = ["".join(cell["source"]) + "\n" for cell in content["cells"] if cell["cell_type"] == "code"]
    assert code == [block.code for block in blocks("docs/tutorial.md", "python")]


def test_notebook_is_one(root):
    nbformat = pytest.importorskip("nbformat")  # of the extra docs
    nbformat.validate(nbformat.read(root / "docs" / "tutorial.ipynb", as_version=4))
