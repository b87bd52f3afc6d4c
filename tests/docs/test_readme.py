"""What a stranger meets in the README: pictures that move, words that are explained, claims that are whole."""

from __future__ import annotations

import re

import pytest
from doc_pages import PAGES, ROOT, blocks
from PIL import Image, ImageSequence

README = PAGES["README.md"]
PICTURES = ("docs/figures/error_falls.gif", "docs/figures/grasp.gif")


def paragraphs(text: str) -> list[str]:
    """Blocks of lines between empty lines, each on one line; items of a list are blocks of their own."""
    return [" ".join(part.split()) for part in re.split(r"\n\n|\n(?=- )", text)]


def test_first_section_says_for_whom_and_shows_both_pictures():
    first = README[: README.index("\n## ")]
    assert "For researchers" in first
    assert all(picture in first for picture in PICTURES)
    assert "python tools/readme_pictures.py" in first


def test_pictures_move_and_are_small():
    assert sum((ROOT / picture).stat().st_size for picture in PICTURES) < 3e6
    for picture in PICTURES:
        with Image.open(ROOT / picture) as moving:
            assert (moving.format, moving.info["loop"]) == ("GIF", 0)
            assert len(list(ImageSequence.Iterator(moving))) > 10


@pytest.mark.parametrize(
    ("word", "meaning"),
    [("κ", "softness, from 0 (hard) to 1 (soft)"), ("b₂", "velocity gain"), (r"\bIB\b", "inductive bias")],
)
def test_words_are_explained_where_they_first_stand(word, meaning):
    first = next(paragraph for paragraph in paragraphs(README) if re.search(word, paragraph))
    assert meaning in first


@pytest.mark.parametrize("page", ["README.md", "docs/quickstart.md"])
def test_code_is_fetched_before_it_is_set_up(page):
    block = next(block.code for block in blocks(page, "sh") if "make setup" in block.code)
    assert block.index("git clone") < block.index("cd forcegrasp") < block.index("make setup")


@pytest.mark.parametrize("page", PAGES)
def test_share_gained_back_is_told_for_both_kinds_of_force(page):
    by_forces_that_act, by_readings = re.findall(r"gains\s+back\s+(\d+ %)", README)
    for paragraph in paragraphs(PAGES[page]):
        if re.search(rf"gains\s+back\D+(\d+\.\d+ \()?{by_forces_that_act}", paragraph):
            assert by_readings in paragraph
            assert re.search("measured|read", paragraph)


def test_the_informed_controller_is_not_called_a_bound():
    assert "what is possible" not in README
    assert "It is no upper bound" in " ".join(README.split())


@pytest.mark.parametrize("page", PAGES)
def test_commands_need_no_more_quotes_in_zsh(page):
    lines = [line for block in blocks(page, "sh") for line in block.code.splitlines()]
    lines += re.findall(r"`(forcegrasp [a-z]+ [^`\n]*)`", PAGES[page])
    for line in lines:
        bare = re.sub(r"'[^']*'|\"[^\"]*\"", "", line.partition(" #")[0])
        assert not re.search(r"[\[\]*?<>{}]", bare), line


def test_table_tells_which_grippers_fit():
    rows = README[README.index("## Does my gripper fit?") : README.index("## Install")].splitlines()
    cells = [[cell.strip() for cell in row.split("|")[1:-1]] for row in rows if row.startswith("| ")][1:]
    assert [row[1].partition(",")[0] for row in cells] == ["yes", "yes", "yes", "yes", "not yet"]
    assert [row[2] for row in cells] == ["yes", "yes", "yes", "yes", "not yet"]
