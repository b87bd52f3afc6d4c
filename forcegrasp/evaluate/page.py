"""An evaluation as a page: the summary, the pictures, and all tables."""

from __future__ import annotations

from pathlib import Path

from matplotlib.figure import Figure

from forcegrasp.evaluate.summary import legend, sentences, short_sheet
from forcegrasp.evaluate.tables import sheets
from forcegrasp.reports.html import Picture, Section, Table, Text, write_report


def write_page(path: Path, report: dict, boxes: dict[str, Figure], traces: dict[str, Figure]) -> Path:
    """Writes an evaluation as one HTML file.

    Args:
      path: the file.
      report: what ``evaluation.json`` has.
      boxes: name → box plot over cells.
      traces: policy → forces of some of its grasps.

    Raises:
      ConfigError: if it can't be written.
    """
    said = sentences(report)
    sections = [
        Section("In short", [Table(*short_sheet(report).in_lines()), Text(legend(report)), *map(Text, said[2:])]),
        Section(
            "By " + report["what"],
            [
                Picture(figure, f"{name.replace('_', ' ').capitalize()}. Box: middle half of the grasps; line: median.")
                for name, figure in boxes.items()
            ],
        ),
        Section(
            "Forces of some grasps, from the first cell to the last",
            [
                Picture(figure, f"{name}. Thick: the force itself; thin: what the sensor says, with its noise.")
                for name, figure in traces.items()
            ],
        ),
        *(Section(sheet.title[:1].upper() + sheet.title[1:], [Table(*sheet.in_lines())]) for sheet in sheets(report)),
    ]
    facts = {name: str(report[name]) for name in ("seed", "trials", "steps", "physics", "model", "baseline")}
    return write_report(
        path, f"Policies compared: {', '.join(report['policies'])}", " ".join(said[:2]), sections, facts
    )
