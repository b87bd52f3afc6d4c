"""One HTML file that works offline: the answer, text, tables, figures and a view to click in; nothing is loaded."""

from __future__ import annotations

import base64
import hashlib
import io
from collections.abc import Sequence
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path
from typing import Any

import jinja2
import matplotlib as mpl
from markupsafe import Markup
from matplotlib.figure import Figure

from forcegrasp import __version__
from forcegrasp.errors import writing


@dataclass(frozen=True)
class Text:
    """A paragraph; ``strong`` sets it apart as the answer."""

    text: str
    strong: bool = False


@dataclass(frozen=True)
class Table:
    """A table of short texts. ``marked`` rows are highlighted."""

    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    marked: frozenset[int] = frozenset()


@dataclass(frozen=True)
class Picture:
    """A figure with what to see in it; the figure is drawn when the report is written."""

    figure: Figure
    caption: str
    in_view: bool = False  #: whether a :class:`View` shows the same: where scripts run, the figure is hidden


@dataclass(frozen=True)
class View:
    """Maps and traces to click in, drawn by ``view.js``, which says what data it reads."""

    data: dict[str, Any]


@dataclass(frozen=True)
class Section:
    """A heading and what stands under it."""

    title: str
    blocks: list[Text | Table | Picture | View] = field(default_factory=list)

    @property
    def in_view(self) -> bool:
        """Whether nothing is in it that a view does not show."""
        return bool(self.blocks) and all(isinstance(block, Picture) and block.in_view for block in self.blocks)

    @property
    def needs_script(self) -> bool:
        """Whether nothing is in it without a script."""
        return bool(self.blocks) and all(isinstance(block, View) for block in self.blocks)


@dataclass(frozen=True)
class Command:
    """What to do next."""

    purpose: str  #: such as "train with it"
    line: str  #: to type

    def __str__(self) -> str:
        return f"{self.purpose}: {self.line}"


@dataclass(frozen=True)
class Answer:
    """The box above everything else: what, how much of it, how sure, and what to do next."""

    what: str
    rows: Sequence[tuple[str, str]] = ()  #: such as "How sure" and a sentence
    shares: Sequence[tuple[str, float]] = ()  #: parts of the error, such as "backlash 83%", drawn as one bar
    commands: Sequence[Command] = ()  #: the next one first


def write_report(
    path: str | Path, title: str, lead: str | Answer, sections: Sequence[Section], facts: dict[str, str]
) -> Path:
    """Writes a report.

    Args:
      path: the HTML file.
      title: what was asked.
      lead: the answer, or one or two sentences.
      sections: what the answer rests on.
      facts: name → value, for the last lines: set, fingerprint, versions.

    Raises:
      ConfigError: if the file can't be written.
    """
    path = Path(path)
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("forcegrasp.reports", "."), autoescape=True, undefined=jinja2.StrictUndefined
    )
    environment.globals.update(svg=_svg, kind=lambda block: type(block).__name__)
    environment.policies["json.dumps_kwargs"] = {"separators": (",", ":"), "allow_nan": False}
    script = (files("forcegrasp.reports") / "view.js").read_text("utf-8") if any(map(_has_view, sections)) else ""
    html = environment.get_template("report.html").render(
        title=title,
        answer=Answer(lead) if isinstance(lead, str) else lead,
        sections=sections,
        facts={**facts, "forcegrasp": __version__},
        script=Markup(script),
        # a browser runs this script and no other, whatever a name may smuggle in
        script_hash=base64.b64encode(hashlib.sha256(script.encode()).digest()).decode(),
    )
    with writing(path.parent):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(html, encoding="utf-8")
    return path


def _has_view(section: Section) -> bool:
    return any(isinstance(block, View) for block in section.blocks)


_drawn = 0


def _svg(figure: Figure) -> Markup:
    """A figure as inline SVG; text stays text, so that it can be searched."""
    global _drawn
    _drawn += 1
    buffer = io.StringIO()
    # ids of all figures share one document
    with mpl.rc_context({"svg.fonttype": "none", "svg.hashsalt": f"figure {_drawn}"}):
        figure.savefig(buffer, format="svg", bbox_inches="tight", metadata={"Date": None})
    svg = buffer.getvalue()
    return Markup(svg[svg.index("<svg") :])
