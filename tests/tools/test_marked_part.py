"""Text between the marks of a page is replaced, and nothing else."""

from __future__ import annotations

import pytest

from tools.marked_part import marks, with_part


def test_what_stands_between_the_marks_is_replaced():
    (begin, end), other = marks("me"), "\n".join(marks("another"))
    page = f"before\n{other}\n{begin}\nold\n{end}\nafter\n"
    assert with_part(page, "me", "\nnew\n") == f"before\n{other}\n{begin}\n\nnew\n\n{end}\nafter\n"
    assert with_part(with_part(page, "me", "a"), "me", "b") == with_part(page, "me", "b")


@pytest.mark.parametrize("missing", [0, 1])
def test_a_mark_that_is_missing_is_named(missing):
    mark = marks("me")[missing]
    with pytest.raises(SystemExit, match=f"the page lacks {mark}"):
        with_part("\n".join(marks("me")).replace(mark, ""), "me", "new")
