"""What the documentation is made of: its pages, and their code blocks."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
#: Every page that a reader may open, by its path from the checkout.
PAGES = {
    path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8")
    for path in sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), *ROOT.glob("forcegrasp/policies/*/card.md")])
}
_BLOCK = re.compile(r"^```(\w+)(?: (\S+))?\n(.*?)^```$", re.MULTILINE | re.DOTALL)


@dataclass(frozen=True)
class Block:
    """A fenced block of a page."""

    language: str
    file: str  #: the file that it is said to be (the word after the language), or empty
    code: str
    line: int  #: of the page, before its first one


def blocks(page: str, language: str = "") -> list[Block]:
    """The blocks of a page, or those of one language."""
    text = PAGES[page]
    found = [Block(m[1], m[2] or "", m[3], text[: m.start(3)].count("\n")) for m in _BLOCK.finditer(text)]
    return [block for block in found if language in ("", block.language)]


def program(page: str) -> str:
    """The Python blocks of a page that are no files, as one program with the page's own line numbers."""
    code = ""
    for block in blocks(page, "python"):
        if not block.file:
            code += "\n" * (block.line - code.count("\n")) + block.code
    return code


def unpack(page: str, folder: Path) -> None:
    """Writes the files that a page shows."""
    for block in blocks(page):
        if block.file:
            (folder / block.file).write_text(block.code, encoding="utf-8")
