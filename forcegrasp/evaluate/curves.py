"""Learning curves: groups runs by what differs except the seed, and averages over seeds."""

from __future__ import annotations

import dataclasses
import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Table
from scipy.stats import t as student

from forcegrasp.config import TrainConfig
from forcegrasp.runs.history import History, find_histories, flat

#: What is drawn and printed: column of metrics.csv, heading, digits. The rewards are of the true forces.
CURVES = (
    ("episode/force_reward_normalised", "force reward, normalised form", 1),
    ("episode/force_reward_paper", "force reward, paper's form", 1),
    ("episode/displacement_until_grasped_mm", "object moved until both touch [mm]", 3),
    ("episode/fast_steps", "steps over the speed threshold", 2),
)
#: The same for the head of a narrow table.
SHORT = ("force\nreward,\nnormalised", "force\nreward,\npaper's", "object\nmoved [mm]", "fast\nsteps")
#: Share of a training, at its end, that the table averages over.
LAST = 0.1
#: Frames at which curves are compared.
POINTS = 200
#: Options that change no result, or only which random numbers it came from.
_INDIFFERENT = ("seed", "physics.threads", "log.")


@dataclass
class Group:
    """Runs that differ in nothing but the seed."""

    label: str
    runs: list[History]

    @property
    def averaged(self) -> list[History]:
        """The finished runs, or all of them while there is none: a mean must not jump where one of them ends."""
        return [run for run in self.runs if run.finished] or self.runs

    def mean(self, column: str, frames: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Mean over seeds and its 95 % t-interval, each ``(len(frames),)``; NaN where a run has no value."""
        return interval(np.stack([_at(run, column, frames) for run in self.averaged]))

    def last(self, column: str) -> np.ndarray:
        """Mean over the last tenth of what each averaged run has trained, ``(runs,)``."""
        return np.array([run.values[column][run.frames > (1 - LAST) * run.frames[-1]].mean() for run in self.averaged])


def _at(run: History, column: str, frames: np.ndarray) -> np.ndarray:
    return np.interp(frames, run.frames, run.values[column], left=np.nan, right=np.nan)


def interval(values: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mean over the first axis and its 95 % interval by Student's t; NaN as interval of a single value."""
    n, mean = len(values), values.mean(axis=0)
    if n == 1:
        return mean, np.full_like(mean, np.nan), np.full_like(mean, np.nan)
    half = student.ppf(0.975, n - 1) * values.std(axis=0, ddof=1) / math.sqrt(n)
    return mean, mean - half, mean + half


# --- grouping ---------------------------------------------------------------------------------------------------------


def group_runs(runs: list[History]) -> tuple[list[Group], list[str]]:
    """Puts runs that differ in nothing but the seed together, in the order in which they come.

    Returns:
      The groups, and a line for each run that is left out because another one has its configuration and seed.
    """
    differing = _differing(runs)
    groups: dict[str, dict[int, History]] = {}
    notes = []
    for run in runs:
        seeds = groups.setdefault(_said(run, differing), {})
        twin = seeds.get(run.seed)
        if twin:
            run, less = (run, twin) if run.frames[-1] > twin.frames[-1] else (twin, run)
            notes.append(f"{less.path} left out: same configuration and seed as {run.path}")
        seeds[run.seed] = run
    members = [[seeds[seed] for seed in sorted(seeds)] for seeds in groups.values()]
    return [Group(label, runs) for label, runs in zip(_labels(members), members, strict=True)], notes


def _labels(members: list[list[History]]) -> list[str]:
    """The experiment's name, and what tells groups of one experiment apart: options off their defaults."""
    defaults = flat(dataclasses.asdict(TrainConfig()))
    labels = []
    for runs in members:
        name = runs[0].experiment if len({run.experiment for run in runs}) == 1 else ""
        rivals = [other[0] for other in members if not name or other[0].experiment == name]
        unusual = [option for option in _differing(rivals) if runs[0].options[option] != defaults.get(option)]
        labels.append(" ".join(filter(None, (name, _said(runs[0], unusual)))) or "defaults")
    return labels


def _differing(runs: list[History]) -> list[str]:
    """Names of the options that are not the same in all runs, less those that do not matter."""
    names = list(dict.fromkeys(name for run in runs for name in run.options))
    return [
        name
        for name in names
        if not name.startswith(_INDIFFERENT) and len({repr(run.options.get(name)) for run in runs}) > 1
    ]


def _said(run: History, names: list[str]) -> str:
    return " ".join(f"{name}={run.options.get(name)}".replace(" ", "").replace("'", "") for name in names)


# --- reporting --------------------------------------------------------------------------------------------------------


def learning_curves(folders: list[Path], out: Path, console: Console | None = None) -> dict[str, Any]:
    """Draws ``curves.png``, writes ``curves.json`` (which is returned) and prints the end of training per group.

    Raises:
      CheckpointError: if there is no run, or one can't be read.
    """
    from forcegrasp.evaluate.curve_figure import draw_curves

    console = console or Console()
    runs, notes = find_histories(folders, [column for column, *_ in CURVES])
    groups, left_out = group_runs(runs)
    cut = [f"{r.path} unfinished: {r.frames[-1]:,.0f} of {r.total:,} frames" for r in runs if not r.finished]
    frames = np.linspace(min(r.frames[0] for r in runs), max(r.frames[-1] for r in runs), POINTS)
    report = {
        "folders": [str(folder) for folder in folders],
        "interval": "95 % t-interval of the mean over seeds",
        "last": LAST,
        "notes": [*notes, *left_out, *cut],
        "groups": {group.label: _summary(group, frames) for group in groups},
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


def _summary(group: Group, frames: np.ndarray) -> dict[str, Any]:
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
