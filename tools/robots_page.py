"""Writes the table of the prior into docs/robots.md.

python -m tools.robots_page
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from forcegrasp.models.object_body import ObjectBody
from forcegrasp.models.robot_prior import EFFECTS, FRICTION, GAINS, MASS, NOISE
from forcegrasp.models.robots import size_ranges
from forcegrasp.physics import default_gripper
from tools.marked_part import with_part

PAGE = Path(__file__).resolve().parent.parent / "docs" / "robots.md"
WRITER = "tools/robots_page.py"


def table() -> Iterator[str]:
    """The lines of the table, with the sizes of the paper's gripper."""
    yield "| | how often | sizes of the paper's gripper | why |\n|---|---|---|---|"
    ranges = size_ranges(default_gripper())
    for name, prior in EFFECTS.items():
        if name == ObjectBody.name:
            continue
        sizes = ", ".join(
            f"{p.name.rpartition('_')[0] or p.name} {low:.2g} to {high:.2g} {p.unit}".replace(" 1,", ",").removesuffix(
                " 1"
            )
            for p, low, high in ranges[name]
        )
        signed = " (±)" if prior.either_sign and any(p.low < 0 for p, _, _ in ranges[name]) else ""
        yield f"| `{name}` | {100 * prior.chance:.0f} % | {sizes}{signed} | {prior.why} |"
    always = (
        ("servo gains", GAINS),
        ("noise σ", NOISE),
        ("mass of the object", MASS),
        ("friction of contacts", FRICTION),
    )
    for what, (low, high, why) in always:
        yield f"| {what} | always | × {low:g} to {high:g} | {why} |"


def page(text: str) -> str:
    """The page with the table as it is now."""
    mean = sum(prior.chance for prior in EFFECTS.values()) - 1  # every object has a body
    said = f"A robot has {mean:.1f} effects on average."
    return with_part(text, WRITER, "\n".join([*table(), "", said]))


if __name__ == "__main__":
    PAGE.write_text(page(PAGE.read_text("utf-8")), "utf-8")
