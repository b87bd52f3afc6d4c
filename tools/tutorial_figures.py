"""Runs the commands of docs/compare-your-data.md, writes what they print into the page, and draws its pictures.

    python tools/tutorial_figures.py [--folder FOLDER]

Each ```sh block is run line by line; the ```text block after it gets what its last command printed, but for the lines
of progress, whose seconds are never the same. Pictures are those of the commands' own reports. Training is left out.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import re
import shlex
import sys
import tempfile
from pathlib import Path
from unittest import mock

from forcegrasp.cli.main import main
from forcegrasp.reports import html as report

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "compare-your-data.md"
FIGURES = ROOT / "docs" / "figures"
COMMANDS = re.compile(r"^```sh\n(.*?)^```\n(?:\n```text\n(.*?)^```\n)?", re.MULTILINE | re.DOTALL)
#: Folder of the report, section of the report (its beginning), which of the section's pictures → file.
PICTURES = {
    ("runs/where", "Error by signal and phase", 0): "compare_where.png",
    ("runs/where", "The worst grasps", 0): "compare_worst_grasp.png",
    ("runs/why", "1. ", 0): "compare_symptom.png",
    ("runs/add_", "Before and after", 0): "compare_fall.png",
    ("runs/after", "The worst grasps", 0): "compare_after.png",
    ("runs/simple", "What to record next", 0): "compare_next_grasp.png",
}


def commands(block: str) -> list[list[str]]:
    """The commands of a block, each as a list of arguments."""
    return [shlex.split(line, comments=True) for line in block.replace("\\\n", " ").splitlines() if line.strip()]


def run(arguments: list[str]) -> str:
    """Runs ``forcegrasp ...`` in this process; returns what it printed, without the lines of progress."""
    out = io.StringIO()
    program, *rest = arguments
    if program != "forcegrasp":
        raise SystemExit(f"{PAGE}: only forcegrasp can be run, not {program}")
    with contextlib.redirect_stdout(out):
        status = main(rest)
    if status:
        raise SystemExit(f"{shlex.join(arguments)}: ended with {status}")
    kept = (line.rstrip() for line in out.getvalue().splitlines() if not re.match(r"  \[ *\d+ s\]", line))
    return "\n".join(kept).strip("\n") + "\n"


def draw(path: Path, sections: list[report.Section]) -> None:
    """Writes those pictures of a report that the page shows."""
    for (folder, title, index), name in PICTURES.items():
        if not path.parent.as_posix().startswith(folder):
            continue
        for section in sections:
            if section.title.startswith(title):
                pictures = [block for block in section.blocks if isinstance(block, report.Picture)]
                pictures[index].figure.savefig(FIGURES / name, dpi=110, bbox_inches="tight", metadata={"Software": ""})
                print(f"drew {name}: {pictures[index].caption}", file=sys.stderr)


def make(folder: Path) -> None:
    """Runs all commands in a folder, and rewrites the page."""
    write, text = report.write_report, PAGE.read_text("utf-8")

    def write_and_draw(path, title, lead, sections, facts):
        draw(path, sections)
        return write(path, title, lead, sections, facts)

    def filled(match: re.Match) -> str:
        wanted, printed = commands(match[1]), ""
        if any(arguments[1] in ("train", "evaluate") for arguments in wanted):
            return match[0]
        for arguments in wanted:
            print(shlex.join(arguments), flush=True)
            printed = run(arguments)
        if match[2] is None:
            return match[0]
        return f"```sh\n{match[1]}```\n\n```text\n{printed}```\n"

    with mock.patch.object(report, "write_report", write_and_draw), contextlib.chdir(folder):
        text = COMMANDS.sub(filled, text)
    PAGE.write_text(text, "utf-8")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--folder", help="where to run, and to leave the results; a new one that is removed otherwise")
    chosen = parser.parse_args().folder
    with tempfile.TemporaryDirectory() as new:
        make(Path(chosen or new))
