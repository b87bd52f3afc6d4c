"""One HTML file that works offline: text, tables and figures, nothing loaded from anywhere."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import jinja2
import matplotlib as mpl
from markupsafe import Markup
from matplotlib.figure import Figure

from forcegrasp import __version__
from forcegrasp.errors import ConfigError


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


@dataclass(frozen=True)
class Section:
    """A heading and what stands under it."""

    title: str
    blocks: list[Text | Table | Picture] = field(default_factory=list)


def write_report(path: str | Path, title: str, lead: str, sections: Sequence[Section], facts: dict[str, str]) -> Path:
    """Writes a report.

    Args:
      path: the HTML file.
      title: what was asked.
      lead: the answer in one or two sentences.
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
    html = environment.get_template("report.html").render(
        title=title, lead=lead, sections=sections, facts={**facts, "forcegrasp": __version__}
    )
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(html, encoding="utf-8")
    except OSError as error:
        raise ConfigError(f"out={path.parent}: could not write ({error.strerror})") from error
    return path


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
