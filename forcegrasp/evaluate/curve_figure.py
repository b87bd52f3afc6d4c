"""The picture of learning curves: a panel per figure, a colour per group, a band over seeds."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from forcegrasp.evaluate.colours import policy_colours
from forcegrasp.evaluate.curve_groups import CURVES, Group


def draw_curves(groups: list[Group], frames: np.ndarray) -> Figure:
    """Means over seeds against ``frames`` ``(n,)``, with their 95 % t-intervals; thin lines are single seeds."""
    figure = Figure(figsize=(11, 7.6), layout="constrained")
    panels = figure.subplots(2, 2, sharex=True)
    end, colours = _end_of_curriculum(groups), policy_colours(group.label for group in groups)
    for axes, (column, heading, _) in zip(panels.flat, CURVES, strict=True):
        for group in groups:
            _draw_group(axes, group, column, frames, colours[group.label])
        axes.set_title(heading, fontsize=10)
        axes.grid(alpha=0.25)
        low, high = _limits(groups, column)
        axes.set_ylim(low, high)
        if end:
            axes.axvline(end / 1e6, color="#888888", ls=":", lw=1)
    for axes in panels[1]:
        axes.set_xlabel("frames [million]" + ("; the curriculum ends at the dotted line" if end else ""))
        axes.set_xlim(0, frames[-1] / 1e6)
    handles, labels = panels[0, 0].get_legend_handles_labels()
    columns = max(1, min(4, 130 // max(map(len, labels))))
    figure.legend(handles, labels, loc="outside upper center", ncols=columns, frameon=False)
    return figure


def _draw_group(axes: Axes, group: Group, column: str, frames: np.ndarray, colour: str) -> None:
    for run in group.runs:
        style = "-" if run.finished else "--"
        axes.plot(run.frames / 1e6, run.values[column], color=colour, lw=0.5, alpha=0.5, ls=style)
    mean, low, high = group.mean(column, frames)
    seeds = len(group.averaged)
    name = group.label.replace("$", r"\$")  # no mathematics in it
    label = f"{name} ({seeds} seed{'s' * (seeds > 1)})"
    axes.plot(frames / 1e6, mean, color=colour, lw=1.8, label=label)
    if seeds > 1:
        axes.fill_between(frames / 1e6, low, high, color=colour, alpha=0.18, lw=0)


def _end_of_curriculum(groups: list[Group]) -> float | None:
    """Frames after which nothing is annealed, if that is the same for all runs that have a curriculum."""
    runs = [run for group in groups for run in group.runs if run.options["curriculum.enabled"]]
    ends = {run.total * run.options["curriculum.end_fraction"] for run in runs}
    return ends.pop() if len(ends) == 1 else None


def _limits(groups: list[Group], column: str) -> tuple[float, float]:
    """Of the runs themselves: the t-interval of two seeds can be wider than all that ever happened."""
    values = np.concatenate([run.values[column] for group in groups for run in group.runs])
    low, high = min(0.0, float(values.min())), float(values.max())
    return low, high + 0.05 * (high - low) + 1e-9
