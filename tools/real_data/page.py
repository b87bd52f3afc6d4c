"""Writes what the studies found into the marked parts of a page."""

from __future__ import annotations

import re
from pathlib import Path

from tools.real_data.pictures import draw_all
from tools.real_data.study import Study

_BEGIN, _END = "<!-- made by tools/real_data: {} -->", "<!-- end of {} -->"


def write_page(page: Path, out: Path, names: list[str]) -> None:
    """Puts tables into the page's marked parts, and pictures into `figures` beside it.

    Raises:
      SystemExit: if the page has no such part.
    """
    studies = [Study.read(out / name) for name in names if (out / name / "study.json").is_file()]
    text = page.read_text()
    for study in studies:
        text = _replaced(text, study.name, "\n".join(_lines(study)))
    text = _replaced(text, "checksums", "\n".join(_checksums(studies, text)))
    page.write_text(text)
    draw_all(studies, out, page.parent / "figures")


def _replaced(text: str, name: str, new: str) -> str:
    begin, end = _BEGIN.format(name), _END.format(name)
    if begin not in text:
        raise SystemExit(f"the page lacks {begin}")
    pattern = re.compile(re.escape(begin) + ".*?" + re.escape(end), re.DOTALL)
    return pattern.sub(lambda _: f"{begin}\n{new}\n{end}", text, count=1)


def _table(rows: list[list[str]]) -> list[str]:
    lines = ["| " + " | ".join(row) + " |" for row in rows]
    return ["", lines[0], "|" + "---|" * len(rows[0]), *lines[1:], ""]


def _lines(study: Study) -> list[str]:
    found = ", ".join(f"`{name}`" for name in study.found) or "nothing"
    rivals = f" (or {', '.join(f'`{name}`' for name in study.rivals)}: these data can't tell)" if study.rivals else ""
    lines = [
        f"Base model: {study.base}. {study.split[0].upper()}{study.split[1:]}.",
        f"Verdict `{study.verdict}`: found {found}{rivals}. {study.seconds:.0f} s on two busy cores.",
    ]
    rows = [["held out", "base model", "with what was found", "authors' model", "÷ assumed noise"]]
    for e in study.errors:
        yard = "–" if e.yardstick is None else f"{e.yardstick:.3g} {e.unit}"
        ratio = f"{e.before / e.noise:.3g} → {e.after / e.noise:.3g}" if e.noise == e.noise else "–"
        rows.append([e.signal.replace("_", " "), f"{e.before:.3g} {e.unit}", f"{e.after:.3g} {e.unit}", yard, ratio])
    lines += _table(rows)
    rows = [["parameter", "fitted [95 %]", "published"]]
    for p in study.parameters:
        shown = "–" if p.published is None else f"{p.published:.4g} {p.unit}"
        rows.append([f"`{p.name}`", f"{p.value:.4g} [{p.low:.4g}, {p.high:.4g}] {p.unit}", shown])
    lines += _table(rows)
    for title, table in study.tables.items():
        lines += [f"{title}:", *_table(table)]
    lines += [f"- {note}" for note in study.notes]
    return lines


def _checksums(studies: list[Study], text: str) -> list[str]:
    """Those of the studies' files, and what the page has of the files of others."""
    files = {name: digest for study in studies for name, digest in study.files.items()}
    folders = {name.split("/")[0] for name in files}
    known = re.findall(r"^\| `(\S+)` \| `([0-9a-f]{64})` \|$", text, re.MULTILINE)
    files |= {name: digest for name, digest in known if name.split("/")[0] not in folders}
    return _table([["file", "SHA-256"], *([f"`{name}`", f"`{digest}`"] for name, digest in sorted(files.items()))])
