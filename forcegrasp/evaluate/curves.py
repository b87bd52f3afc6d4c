"""Learning curves of a sweep: picture, numbers and the table of where training ended."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from forcegrasp.evaluate.curve_figure import draw_curves
from forcegrasp.evaluate.curve_groups import CURVES, LAST, Group, group_runs, interval
from forcegrasp.runs.history import find_histories

#: Headings of :data:`CURVES` in a narrow table.
SHORT = ("force\nreward,\nnormalised", "force\nreward,\npaper's", "object\nmoved [mm]", "fast\nsteps")
#: Frames at which curves are compared.
POINTS = 200


def learning_curves(folders: Sequence[str | Path], out: str | Path, console: Console | None = None) -> dict[str, Any]:
    """Draws ``curves.png``, writes ``curves.json`` (which is returned) and prints the end of training per group.

    Raises:
      CheckpointError: if there is no run, or one can't be read.
    """
    out, console = Path(out), console or Console()
    runs, notes = find_histories([Path(folder) for folder in folders], [column for column, *_ in CURVES])
    groups, left_out = group_runs(runs)
    cut = [f"{r.path} unfinished: {r.frames[-1]:,.0f} of {r.total:,} frames" for r in runs if not r.finished]
    frames = np.linspace(min(r.frames[0] for r in runs), max(r.frames[-1] for r in runs), POINTS)
    report = {
        "folders": [str(folder) for folder in folders],
        "interval": "95 % t-interval of the mean over seeds",
        "last": LAST,
        "notes": [*notes, *left_out, *cut],
        "groups": {group.label: summary(group, frames) for group in groups},
    }
    out.mkdir(parents=True, exist_ok=True)
    (out / "curves.json").write_text(json.dumps(report, indent=1, ensure_ascii=False) + "\n", "utf-8")
    draw_curves(groups, frames).savefig(out / "curves.png", dpi=130)
    console.print(_table(groups))
    for note in report["notes"]:
        console.print(note, highlight=False, markup=False, soft_wrap=True)
    console.print(
        f"learning curves are in {out / 'curves.png'}, their numbers in curves.json", highlight=False, soft_wrap=True
    )
    return report


def summary(group: Group, frames: np.ndarray) -> dict[str, Any]:
    summary: dict[str, Any] = {
        "runs": [{"path": str(r.path), "seed": r.seed, "frames": int(r.frames[-1])} for r in group.runs],
        "averaged_seeds": [run.seed for run in group.averaged],
        "frames": [round(frame) for frame in frames],
        "curves": {},
        "end": {},
    }
    for column, *_ in CURVES:
        parts = zip(("mean", "low", "high"), group.mean(column, frames), strict=True)
        summary["curves"][column] = {name: [_json(value) for value in values] for name, values in parts}
        parts = zip(("mean", "low", "high"), interval(group.last(column)), strict=True)
        summary["end"][column] = {name: _json(float(value)) for name, value in parts}
    return summary


def _json(value: float) -> float | None:
    return float(f"{value:.6g}") if math.isfinite(value) else None


def _table(groups: list[Group]) -> Table:
    table = Table(title=f"last {LAST:.0%} of training: mean over seeds ± half of its 95 % t-interval")
    table.add_column("trained with", overflow="fold")
    table.add_column("seeds", justify="right")
    for heading in SHORT:
        table.add_column(escape(heading), justify="right")
    for group in groups:
        cells = []
        for column, _, digits in CURVES:
            mean, _, high = interval(group.last(column))
            cells.append(f"{mean:.{digits}f}" + ("" if math.isnan(high) else f"\n± {high - mean:.{digits}f}"))
        unfinished = "" if group.averaged[0].finished else "\n(unfinished)"
        table.add_row(escape(group.label.replace(" ", "\n")) + unfinished, str(len(group.averaged)), *cells)
    return table
