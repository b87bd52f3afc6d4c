"""Fills in the tables of docs/grippers.md from the results of tools/grippers.py, and draws its picture."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Protocol

from tools.marked_part import with_part
from tools.results.tables import table

DOCS = Path(__file__).resolve().parent.parent / "docs"
PAGE, PICTURE = DOCS / "grippers.md", DOCS / "figures" / "grippers.png"
WRITER = "tools/grippers.py"
#: What every grasp of the picture has in common; the rest is drawn.
GRASP = ("policy=force_pi", "kappa=0.5", "radius_m=0.015", "seed=3")
_GAP = 8

Row = dict[str, Any]


class Results(Protocol):
    """Rows by stage and gripper."""

    def of(self, stage: str, gripper: str) -> list[Row]: ...


def write(results: Results, grippers: Sequence[str], is_right: Callable[[Row], bool], page: Path = PAGE) -> None:
    """Writes what there is so far between the marks of the page."""
    tables = f"{trained(results, grippers)}\n\n{diagnosed(results, grippers, is_right)}"
    page.write_text(with_part(page.read_text("utf-8"), WRITER, tables), "utf-8")
    print(f"wrote {page}")


def trained(results: Results, grippers: Sequence[str]) -> str:
    """The table of trained policies; a cell has the policy's figure, and after the slash that of force_pi."""
    heads = ["gripper", "control steps", "minutes", "force reward", "peak force [N]", "overshoot [%]", "moved [mm]"]
    lines = []
    for gripper in grippers:
        for row in results.of("train", gripper):
            pairs = [
                " / ".join(f"{row['policies'][who][key]:.{digits}f}" for who in ("policy", "force_pi"))
                for key, digits in (("force_reward", 1), ("peak_force_n", 2), ("overshoot_percent", 0), ("moved_mm", 2))
            ]
            lines.append([f"`{gripper}`", f"{row['frames']:,}", f"{row['seconds'] / 60:.1f}", *pairs])
        if not results.of("train", gripper):
            lines.append([f"`{gripper}`", *["–"] * 6])
    return table(heads, lines)


def diagnosed(results: Results, grippers: Sequence[str], is_right: Callable[[Row], bool]) -> str:
    """The table of diagnosed sets, by gripper and what was hidden."""
    lines = []
    for gripper in grippers:
        rows = results.of("diagnose", gripper)
        for hidden in dict.fromkeys(row["hidden"] for row in rows):
            some = [row for row in rows if row["hidden"] == hidden]
            right, ratios = sum(map(is_right, some)), sorted(row["ratio"] for row in some)
            seconds = sum(row["seconds"] for row in some) / len(some)
            error = f"{ratios[len(ratios) // 2]:.2f} ({ratios[-1]:.2f})"
            lines.append([f"`{gripper}`", hidden, f"{right} of {len(some)}", error, f"{seconds:.0f}"])
        if not rows:
            lines.append([f"`{gripper}`", *["–"] * 4])
    return table(["gripper", "hidden", "right", "error ÷ floor, median (largest)", "seconds a set"], lines)


def draw(grippers: Sequence[str], picture: Path = PICTURE) -> None:
    """Draws the end of a grasp with each gripper, as ``forcegrasp render`` shows it, side by side."""
    from PIL import Image, ImageSequence

    from forcegrasp.cli.main import main as forcegrasp
    from forcegrasp.evaluate.grasp_layout import HEIGHT, SCENE_HEIGHT, SCENE_WIDTH

    scenes = []
    with tempfile.TemporaryDirectory() as folder:
        for gripper in grippers:
            video = Path(folder) / f"{gripper}.gif"
            if status := forcegrasp(["render", f"gripper={gripper}", *GRASP, f"out={video}"]):
                raise SystemExit(status)
            with Image.open(video) as moving:
                last = [frame.convert("RGB") for frame in ImageSequence.Iterator(moving)][-1]
            scenes.append(last.crop((0, HEIGHT - SCENE_HEIGHT, SCENE_WIDTH, HEIGHT)))
    whole = Image.new("RGB", (len(scenes) * (SCENE_WIDTH + _GAP) - _GAP, SCENE_HEIGHT), "white")
    for index, scene in enumerate(scenes):
        whole.paste(scene, (index * (SCENE_WIDTH + _GAP), 0))
    whole.quantize(256).save(picture, optimize=True)
    print(f"wrote {picture}")
