"""The site's navigation is made of links in the contents pages; ``make docs`` builds the site itself."""

from __future__ import annotations

import importlib
import re
import runpy

import pytest
from doc_pages import PAGES, ROOT

import forcegrasp


@pytest.fixture(scope="module")
def conf() -> dict:
    return runpy.run_path(str(ROOT / "docs" / "conf.py"))


def test_every_page_is_in_the_navigation_once(conf):
    listed = []
    for name, text in PAGES.items():
        page = ROOT / name
        if page.is_relative_to(ROOT / "docs") and page.stem in conf["CONTENTS"]:
            links = re.findall(r"^(\S+\.md)$", conf["navigation"](page, text), re.MULTILINE)
            listed += [(page.parent / link).resolve() for link in links]
    assert sorted(listed) == sorted(ROOT / name for name in PAGES if name.startswith("docs/") and "index" not in name)


def test_navigation_has_the_order_of_the_page(conf):
    text = (
        "# Title\n\n## One\n\n- [b](speed.md)\n- [a](physics.md#x), [again](speed.md)\n\n## Two\n\n[r](adr/README.md)\n"
    )
    trees = re.findall(r":caption: (.+)\n\n((?:\S+\.md\n)+)", conf["navigation"](ROOT / "docs" / "index.md", text))
    assert [(caption, pages.split()) for caption, pages in trees[:2]] == [
        ("One", ["speed.md"]),
        ("Two", ["adr/README.md"]),
    ]
    caption, rest = trees[2]
    assert caption == "More"
    assert "physics.md" in rest
    assert "speed.md" not in rest


def test_markdown_outside_is_a_download(conf):
    source = ["[a](../forcegrasp/policies/ib/card.md), [b](speed.md), [c](https://x.org/y.md)"]
    conf["read"](None, "results", source)
    assert source == ["[a](path:../forcegrasp/policies/ib/card.md), [b](speed.md), [c](https://x.org/y.md)"]


def test_reference_is_made_of_docstrings(conf):
    source = [PAGES["docs/reference.md"]]
    conf["read"](None, "reference", source)
    modules = re.findall(r"^\.\. automodule:: (\S+)\n   :members:$", source[0], re.MULTILINE)
    assert modules == re.findall(r"^## `(.+)`$", PAGES["docs/reference.md"], re.MULTILINE)
    offered = {name: module for module in modules for name in getattr(importlib.import_module(module), "__all__", ())}
    missing = set(forcegrasp.__all__) - {"ForcegraspError"} - offered.keys()
    assert not missing
    for name, module in offered.items():
        value = getattr(importlib.import_module(module), name)
        assert not callable(value) or value.__doc__, f"{module}.{name} has no docstring"


def test_other_pages_have_no_docstrings(conf):
    source = ["## `forcegrasp.api`\n"]
    conf["read"](None, "python", source)
    assert source == ["## `forcegrasp.api`\n"]
