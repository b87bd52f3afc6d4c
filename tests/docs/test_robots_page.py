"""docs/robots.md has the prior as it is. If this fails: python -m tools.robots_page"""

from __future__ import annotations

from forcegrasp.models.robot_prior import EFFECTS
from tools.robots_page import PAGE, page


def test_the_table_is_up_to_date():
    text = PAGE.read_text("utf-8")
    assert page(text) == text
    assert all(f"| `{name}` | {100 * prior.chance:.0f} % |" in text for name, prior in list(EFFECTS.items())[:-1])
