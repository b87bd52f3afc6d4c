"""Writes results between the marks of pages, and says which of them are older than the code that they measure."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection
from pathlib import Path

from tools.measured_code import ROOT, outdated, without_sentences
from tools.results.blocks import BLOCKS, Block
from tools.results.notes import Note, Notes, stamps
from tools.results.policies import POLICIES
from tools.results.settings import TRIAL, Settings, digests


def write_pages(settings: Settings, notes: Notes, chosen: Collection[str], say: Callable[[str], None]) -> None:
    """Writes every block of the chosen stages that is done; those of a trial into pages of its own."""
    for block in (one for one in BLOCKS if not set(one.stages).isdisjoint(chosen)):
        made = notes.behind(block.stages)
        if made is None:
            missing = [name for name in block.stages if notes.behind([name]) is None]
            say(f"{block.page}, {block.name}: stays as it is, without {', '.join(missing)}")
            continue
        page = settings.into / block.page
        source = page if page.is_file() else ROOT / block.page
        page.parent.mkdir(parents=True, exist_ok=True)
        page.write_text(_with(block, source.read_text("utf-8"), settings, made), "utf-8")


def _with(block: Block, page: str, settings: Settings, made: list[Note]) -> str:
    """The page with this block written anew."""
    who = "the policies of the package" if block.of_package else f"{settings.seeds} seeds"
    said = "\n\n".join(stamps(made, block.name, f", {who}{TRIAL if settings.trial else ''}"))

    def written(found: re.Match[str]) -> str:
        text = block.text(settings.out) if block.text else without_sentences(found[2])
        return f"{found[1]}\n{text}\n\n{said}\n\n{found[3]}"

    return _marked(block.name).sub(written, page)


def _marked(name: str) -> re.Pattern[str]:
    return re.compile(rf"^(<!-- results: {re.escape(name)} -->\n)(.*?)^(<!-- end -->)$", re.DOTALL | re.MULTILINE)


def check(root: Path = ROOT) -> list[str]:
    """A line for each table, picture and card whose code is not noted, or not that of today."""
    now, found = list(digests().values()), []
    for block in BLOCKS:
        marked = _marked(block.name).search((root / block.page).read_text("utf-8"))
        lines = _old(marked[2], now) if marked else ["its marks are not on the page."]
        found += [f"{block.page}, {block.name}: {line}" for line in lines]
    for policy in POLICIES:
        card = f"forcegrasp/policies/{policy.name}/card.md"
        found += [f"{card}: {line}" for line in _old((root / card).read_text("utf-8"), now)]
    return found


def _old(text: str, now: list[str]) -> list[str]:
    """Its sentences that are of no kind of today's code."""
    by_kind = [outdated(text, digest) for digest in now]
    return [line for line in by_kind[0] if all(line in lines for lines in by_kind)]
