"""Runs the Python of docs/tutorial.md, fills in what it prints and draws, and makes docs/tutorial.ipynb of the page.

    python tools/tutorial_notebook.py

The page is the source. After a ```python block come, where there are any, a ```text block with what it printed and the
pictures that it drew; both are replaced. In the notebook they are the cell's output.
"""

from __future__ import annotations

import base64
import contextlib
import io
import json
import re
import tempfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
PAGE, NOTEBOOK = ROOT / "docs" / "tutorial.md", ROOT / "docs" / "tutorial.ipynb"
#: A code block, with the output that follows it.
CELL = re.compile(
    r"^```python\n(?P<code>.*?)^```\n(?:\n```text\n(?P<printed>.*?)^```\n)?(?P<pictures>(?:\n!\[[^\]]*\]\([^)]+\)\n)*)",
    re.MULTILINE | re.DOTALL,
)


@dataclass
class Output:
    """What a block left."""

    printed: str
    pictures: list[bytes] = field(default_factory=list)  #: PNG


def execute(text: str) -> list[Output]:
    """Runs all blocks of the page in order, in the working directory."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    plt.close("all")
    names, outputs = {"__name__": "__main__"}, []
    for cell in CELL.finditer(text):
        out = io.StringIO()
        code = "\n" * text[: cell.start("code")].count("\n") + cell["code"]  # a traceback has the page's lines
        with contextlib.redirect_stdout(out):
            exec(compile(code, str(PAGE), "exec"), names)
        outputs.append(Output(out.getvalue()))
        for number in plt.get_fignums():
            picture = io.BytesIO()
            plt.figure(number).savefig(picture, dpi=90, metadata={"Software": ""})
            outputs[-1].pictures.append(picture.getvalue())
        plt.close("all")
    return outputs


def fill(text: str, outputs: list[Output], folder: Path) -> str:
    """The page with these outputs; writes the pictures beside it, into ``figures``."""
    remaining, count = iter(outputs), 0

    def filled(cell: re.Match) -> str:
        nonlocal count
        output = next(remaining)
        parts = [f"```python\n{cell['code']}```\n"]
        if output.printed:
            parts.append(f"```text\n{output.printed}```\n")
        said = re.findall(r"!\[([^\]]*)\]", cell["pictures"])
        for index, picture in enumerate(output.pictures):
            count += 1
            (folder / "figures" / f"tutorial_{count}.png").write_bytes(picture)
            what = said[index] if index < len(said) else "What the block draws"
            parts.append(f"![{what}](figures/tutorial_{count}.png)\n")
        return "\n".join(parts)

    return CELL.sub(filled, text)


def notebook(text: str, folder: Path) -> dict[str, Any]:
    """The page as a notebook (nbformat 4.5)."""
    cells, place = [], 0
    for number, found in enumerate(CELL.finditer(text)):
        cells.append(prose(text[place : found.start()]))
        outputs: list[dict[str, Any]] = []
        if found["printed"]:
            outputs.append({"output_type": "stream", "name": "stdout", "text": lines(found["printed"])})
        for name in re.findall(r"\(([^)]+)\)", found["pictures"]):
            data = {"image/png": base64.b64encode((folder / name).read_bytes()).decode()}
            outputs.append({"output_type": "display_data", "data": data, "metadata": {}})
        cell = {"cell_type": "code", "execution_count": number + 1, "metadata": {}}
        cells.append({**cell, "source": lines(found["code"]), "outputs": outputs})
        place = found.end()
    cells.append(prose(text[place:]))
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    return {
        "cells": [{"id": f"cell-{index}", **cell} for index, cell in enumerate(cells)],
        "metadata": {"kernelspec": kernel, "language_info": {"name": "python"}},
        "nbformat": 4,
        "nbformat_minor": 5,
    }


def prose(text: str) -> dict[str, Any]:
    return {"cell_type": "markdown", "metadata": {}, "source": lines(text)}


def lines(text: str) -> list[str]:
    """Text as notebooks keep it."""
    return text.strip("\n").splitlines(keepends=True)


def main() -> None:
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        outputs = execute(PAGE.read_text("utf-8"))
    text = fill(PAGE.read_text("utf-8"), outputs, PAGE.parent)
    PAGE.write_text(text, "utf-8")
    content = json.dumps(notebook(text, PAGE.parent), indent=1, ensure_ascii=False)
    NOTEBOOK.write_text(content + "\n", "utf-8")


if __name__ == "__main__":
    main()
