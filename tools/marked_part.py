"""The parts of pages that programs write: text between a mark and its end."""

from __future__ import annotations


def marks(writer: str) -> tuple[str, str]:
    """The two lines between which stands what a program, or a part of one, writes."""
    return f"<!-- written by {writer}: begin -->", f"<!-- written by {writer}: end -->"


def with_part(page: str, writer: str, part: str) -> str:
    """A page's text with this between the writer's marks, in place of what stood there.

    Raises:
      SystemExit: if the page lacks one of the marks.
    """
    begin, end = marks(writer)
    before, found, rest = page.partition(begin)
    _, closed, after = rest.partition(end)
    if not (found and closed):
        raise SystemExit(f"the page lacks {end if found else begin}")
    return f"{before}{begin}\n\n{part.strip()}\n\n{end}{after}"
