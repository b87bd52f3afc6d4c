"""The site's navigation is made of links in the contents pages; ``make docs`` builds the site itself."""

from __future__ import annotations

import re
import runpy

import pytest
from doc_pages import PAGES, ROOT


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
