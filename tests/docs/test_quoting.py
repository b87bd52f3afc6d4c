"""What is shown to be typed means the same in zsh, which takes brackets, stars and the like for names of files."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator

import pytest
from doc_pages import PAGES, ROOT, blocks

QUOTED = re.compile(r"'[^']*'|\"[^\"]*\"|\\.")
PATTERN = re.compile(r"[][*?^~{}<>|()]|(^|\s)=")
SOURCES = sorted((ROOT / "forcegrasp").rglob("*.py"))


def unquoted(line: str) -> str:
    """What a shell sees as its own signs: the line without what is quoted, and without a comment."""
    return re.sub(r"(^|\s)#.*", "", QUOTED.sub("", line))


def typed(page: str) -> Iterator[str]:
    """Lines of a page's shell blocks, and commands and options with a list within its sentences and tables."""
    for block in blocks(page, "sh"):
        yield from block.code.replace("\\\n", " ").splitlines()
    text = re.sub(r"^```.*?^```", "", PAGES[page], flags=re.MULTILINE | re.DOTALL)
    yield from re.findall(r"`(forcegrasp [a-z]+ [^`\n]*|'?[\w.]+=\[[^`\n]*)`", text)


@pytest.mark.parametrize("page", [page for page in PAGES if page not in ("README.md", "CHANGELOG.md")])
def test_pages_quote_what_zsh_would_take_for_a_pattern(page):
    assert [line for line in typed(page) if PATTERN.search(unquoted(line))] == []


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: str(path.relative_to(ROOT)))
def test_hints_quote_what_zsh_would_take_for_a_pattern(path):
    """A list stands within quotes where a text names a command, or begins with an option, as notes do."""
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            bare = r"^(.*forcegrasp [a-z]+ .*| +)(?<!['\"\w.])[\w.]+=\["
            assert not re.search(bare, node.value, re.MULTILINE), node.value


@pytest.mark.parametrize(
    ("line", "taken"),
    [
        ("forcegrasp evaluate policies=[a,b]", True),
        ("forcegrasp evaluate 'policies=[a,b]'    # [a,b] in words", False),
        ("forcegrasp curves runs/*", True),
        ("pip install .[onnx]", True),
        ("forcegrasp train experiment=ib", False),
    ],
)
def test_the_scan_finds(line, taken):
    assert bool(PATTERN.search(unquoted(line))) == taken
