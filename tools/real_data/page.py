"""Writes what the studies found into the marked parts of a page."""

from __future__ import annotations

import re
from pathlib import Path

from tools.marked_part import with_part
from tools.real_data.pictures import draw_all
from tools.real_data.study import Study
from tools.results.tables import table

WRITER = "tools/real_data"


def write_page(page: Path, out: Path, names: list[str]) -> None:
    """Puts tables into the page's marked parts, and pictures into `figures` beside it.

    Raises:
      SystemExit: if the page has no such part.
    """
    studies = [Study.read(out / name) for name in names if (out / name / "study.json").is_file()]
    text = page.read_text()
    for study in studies:
        text = with_part(text, f"{WRITER}, {study.name}", "\n\n".join(_parts(study)))
    text = with_part(text, f"{WRITER}, checksums", _checksums(studies, text))
    page.write_text(text)
    draw_all(studies, out, page.parent / "figures")


def _parts(study: Study) -> list[str]:
    """Paragraphs and tables, to be put one below the other."""
    found = ", ".join(f"`{name}`" for name in study.found) or "nothing"
    rivals = f" (or {', '.join(f'`{name}`' for name in study.rivals)}: these data can't tell)" if study.rivals else ""
    parts = [
        f"Base model: {study.base}. {study.split[0].upper()}{study.split[1:]}.\n"
        f"Verdict `{study.verdict}`: found {found}{rivals}. {study.seconds:.0f} s on two busy cores."
    ]
    rows = []
    for e in study.errors:
        yard = "–" if e.yardstick is None else f"{e.yardstick:.3g} {e.unit}"
        ratio = f"{e.before / e.noise:.3g} → {e.after / e.noise:.3g}" if e.noise == e.noise else "–"
        rows.append([e.signal.replace("_", " "), f"{e.before:.3g} {e.unit}", f"{e.after:.3g} {e.unit}", yard, ratio])
    parts.append(table(["held out", "base model", "with what was found", "authors' model", "÷ assumed noise"], rows))
    rows = []
    for p in study.parameters:
        shown = "–" if p.published is None else f"{p.published:.4g} {p.unit}"
        rows.append([f"`{p.name}`", f"{p.value:.4g} [{p.low:.4g}, {p.high:.4g}] {p.unit}", shown])
    parts.append(table(["parameter", "fitted [95 %]", "published"], rows))
    for title, (heads, *rows) in study.tables.items():
        parts += [f"{title}:", table(heads, rows)]
    return [*parts, "\n".join(f"- {note}" for note in study.notes)]


def _checksums(studies: list[Study], text: str) -> str:
    """Those of the studies' files, and what the page has of the files of others."""
    files = {name: digest for study in studies for name, digest in study.files.items()}
    folders = {name.split("/")[0] for name in files}
    known = re.findall(r"^\| `(\S+)` \| `([0-9a-f]{64})` \|$", text, re.MULTILINE)
    files |= {name: digest for name, digest in known if name.split("/")[0] not in folders}
    return table(["file", "SHA-256"], [[f"`{name}`", f"`{digest}`"] for name, digest in sorted(files.items())])
