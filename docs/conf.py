"""How Sphinx makes a site of these pages: ``make docs``. The pages are plain Markdown, and say nothing about Sphinx.

What the lines of a contents page (index.md, README.md) link to first is its navigation, in the same order and under the
same headings; pages that none of them names are listed at the end, so that none gets lost.
"""

from __future__ import annotations

import re
from pathlib import Path

from forcegrasp import __version__

HERE = Path(__file__).parent

project = "forcegrasp"
author = "the forcegrasp authors"
version = release = __version__
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
autodoc_member_order = "bysource"
autodoc_inherit_docstrings = False  # torchrl documents its own methods
autodoc_typehints = "none"  # the docstrings say what is taken
add_module_names = False
html_theme = "furo"
html_title = f"forcegrasp {__version__}"
html_show_copyright = False
html_copy_source = False
highlight_language = "text"
myst_heading_anchors = 4
nitpicky = True

CONTENTS = ("index", "README")
#: A heading of the reference that is a module; what the module's docstrings say goes below it.
MODULE = re.compile(r"^## `(forcegrasp\.[\w.]+)`\n", re.MULTILINE)
COLON = re.compile(r"(?<!:):(?=\s|$)")
LINK = re.compile(r"\]\(([^)#:]+\.md)\)")


def setup(app) -> None:
    app.connect("source-read", read)
    app.connect("autodoc-process-docstring", without_type, priority=400)  # before Napoleon's 500


def without_type(_app, what: str, _name: str, _object, _options, lines: list[str]) -> None:
    """Puts a dash for the colon of an attribute's first line, before which Napoleon takes all for its type."""
    if what in ("attribute", "data", "property") and lines:
        lines[0] = COLON.sub(" –", lines[0])


def read(_app, name: str, source: list[str]) -> None:
    """Gives contents pages navigation and the reference its docstrings; links outside docs/ become downloads."""
    page = HERE / f"{name}.md"

    def outside(link: re.Match) -> str:
        inside = (page.parent / link[1]).resolve().is_relative_to(HERE)
        return link[0] if inside else f"](path:{link[1]})"

    if page.stem in CONTENTS:
        source[0] += navigation(page, source[0])
    if name == "reference":
        source[0] = MODULE.sub(documented, source[0])
    source[0] = LINK.sub(outside, source[0])


def documented(heading: re.Match) -> str:
    """A heading with what the docstrings of its module say."""
    return f"{heading[0]}\n```{{eval-rst}}\n.. automodule:: {heading[1]}\n   :members:\n```\n"


def navigation(page: Path, text: str) -> str:
    """Hidden tables of contents, one for each heading with links, and one for what is not linked at all."""
    parts, seen = [], set()
    for section in re.split(r"^## ", text, flags=re.MULTILINE):
        firsts = [found[1] for line in section.splitlines() if (found := LINK.search(line))]
        new = [link for link in dict.fromkeys(firsts) if is_below(page, link) and link not in seen]
        seen |= set(new)
        if new:
            parts.append((section.splitlines()[0], new))
    if page.stem == "index":
        rest = sorted(path.name for path in HERE.glob("*.md") if path != page and path.name not in seen)
        parts += [("More", rest)] if rest else []
    return "".join(
        "\n```{toctree}\n:hidden:\n:caption: " + caption.strip("# ") + "\n\n" + "\n".join(links) + "\n```\n"
        for caption, links in parts
    )


def is_below(page: Path, link: str) -> bool:
    """Whether a contents page lists a link's page: one beside it, or the contents page of a folder below it."""
    target = (page.parent / link).resolve()
    if target.stem in CONTENTS:
        return target.parent.parent == page.parent
    return target.parent == page.parent
