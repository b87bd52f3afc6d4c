"""docs/effects/ says what the catalogue says. If this fails: python tools/effect_pages.py"""

from __future__ import annotations

import re
import runpy
from pathlib import Path

import pytest

from forcegrasp.effects import catalogue

MAX_BYTES = 60_000
MAKE = "python tools/effect_pages.py makes the pages"


@pytest.fixture(scope="module")
def folder(root) -> Path:
    return root / "docs" / "effects"


@pytest.fixture(scope="module")
def tool(root) -> dict:
    return runpy.run_path(str(root / "tools" / "effect_pages.py"))


@pytest.mark.parametrize("name", catalogue())
def test_page(name, folder, tool):
    effect, page = catalogue()[name], folder / f"{name}.md"
    assert page.is_file(), MAKE
    text = page.read_text(encoding="utf-8")
    assert text == tool["page"](effect), MAKE
    rows = re.findall(r"^\| `(\w+)` \| .* \| (\S+) \| (\S+) to (\S+) \| (\S+) \|", text, re.MULTILINE)
    assert rows == [(p.name, p.unit, f"{p.low:g}", f"{p.high:g}", f"{p.typical:g}") for p in effect.parameters]
    assert all((folder / linked).is_file() for linked in re.findall(r"\]\(([^)]+)\)", text))
    picture = folder / f"{name}.png"
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert picture.stat().st_size <= MAX_BYTES


def test_index(folder, tool):
    text = (folder / "README.md").read_text(encoding="utf-8")
    assert text == tool["index"](), MAKE
    assert re.findall(r"^\| \[(\w+)\]\(\1\.md\)", text, re.MULTILINE) == list(catalogue())


def test_no_page_of_a_forgotten_effect(folder):
    expected = {"README.md"} | {f"{name}.{kind}" for name in catalogue() for kind in ("md", "png")}
    assert {path.name for path in folder.iterdir()} == expected, MAKE


def test_every_page_shows_a_grasp_of_its_own_or_the_default(tool):
    assert set(tool["_PLANS"]) <= set(catalogue())


def test_pages_are_made(tool, tmp_path):
    tool["draw"](catalogue()["force_bias"], tmp_path / "force_bias.png")
    assert 1000 < (tmp_path / "force_bias.png").stat().st_size <= MAX_BYTES
