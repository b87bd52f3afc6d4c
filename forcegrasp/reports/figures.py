"""The pictures of the reports: what was measured, what the model says, and where they part."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from forcegrasp.identify.comparison import of_width
from forcegrasp.identify.target import Target
from forcegrasp.models.model_file import Fitted

#: Okabe and Ito's colours, told apart by the colour-blind.
LEFT, RIGHT, WITHOUT, WITH, MEASURED = "#0072b2", "#d55e00", "#d55e00", "#0072b2", "#444444"
SECOND = "#009e73"
_COLOURS = (LEFT, RIGHT, SECOND, "#cc79a7", "#e69f00", "#56b4e9")
#: Shown unit of a signal's unit, and its factor.
SHOWN = {"m": ("mm", 1e3), "rad": ("mrad", 1e3), "N": ("N", 1.0), "N·m": ("N·m", 1.0)}
NAMES = {
    "position_l": "position left", "position_r": "position right", "force_l": "force left", "force_r": "force right",
}  # fmt: skip
#: Covariate → its axis' words and the factor from SI, where motors slide; where they turn, mm are mrad.
AXES = {
    "time_since_contact_s": ("time since contact [s]", 1.0),
    "velocity_m_s": ("velocity [mm/s]", 1e3),
    "direction": ("direction of motion", 1.0),
    "force_n": ("force [N]", 1.0),
    "command_m": ("command [mm]", 1e3),
    "position_m": ("position [mm]", 1e3),
    "time_s": ("time since its start [s]", 1.0),
}
_POINTS = 1200  # more would only make the file large
_DOTS = 250
_ROWS = 40
_BINS = 14


def plain(text: str, longest: int = 32) -> str:
    """A name as it is to be drawn: no formulas, not too long."""
    short = text if len(text) <= longest else text[: longest - 1] + "…"
    return short.replace("$", r"\$")


def heat_map(grid: np.ndarray, rows: Sequence[str], columns: Sequence[str]) -> Figure:
    """Errors ÷ noise as coloured cells, ``(rows, columns)``; NaN stays empty. Of many rows the worst are drawn."""
    chosen = np.arange(len(rows))
    if len(rows) > _ROWS:
        chosen = np.sort(np.argsort(-np.nanmax(grid, axis=1))[:_ROWS])
    grid, rows = grid[chosen], [rows[i] for i in chosen.tolist()]
    top = max(2.0, float(np.nanmax(grid, initial=0)))
    figure = Figure(figsize=(7.5, 1.1 + 0.27 * len(rows)), layout="constrained")
    axes = figure.subplots()
    # below 1 there is nothing to see; a logarithm keeps one bad cell from hiding all others
    image = axes.imshow(np.log(np.maximum(grid, 1.0)), cmap="cividis", vmin=0, vmax=np.log(top), aspect="auto")
    for (row, column), value in np.ndenumerate(grid):
        if np.isfinite(value):
            dark = np.log(max(value, 1.0)) < 0.55 * np.log(top)
            text = f"{value:.1f}" if value < 100 else f"{value:.0f}"
            axes.text(column, row, text, ha="center", va="center", fontsize=8, color="white" if dark else "black")
    axes.set_xticks(range(len(columns)), [plain(c).replace("_", " ") for c in columns])
    axes.set_yticks(range(len(rows)), [plain(r) for r in rows], fontsize=8)
    axes.tick_params(length=0)
    axes.spines[:].set_visible(False)
    ticks = [t for t in (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000) if t <= top]
    bar = figure.colorbar(image, ax=axes, ticks=np.log(ticks), label="error ÷ sensor noise", pad=0.02)
    bar.ax.set_yticklabels([str(t) for t in ticks])
    bar.outline.set_visible(False)
    return figure


def overlay(target: Target, index: int, predicted: np.ndarray) -> Figure:
    """One grasp: measured and predicted positions and forces, residuals ÷ noise below. ``predicted``: ``(S, C)``."""
    grasp = target.grasps[index]
    time, keep = grasp.time_s - grasp.time_s[0], _thin(len(grasp.time_s))
    measured, predicted = target.signals[index][: len(time)][keep], predicted[: len(time)]
    residual = (measured - predicted[keep]) / target.sigma
    figure = Figure(figsize=(9.5, 4.6), layout="constrained")
    grid = figure.subplots(2, len(target.axis.kinds), sharex=True, height_ratios=(2.2, 1), squeeze=False)
    for column, (kind, part) in enumerate(target.axis.kinds.items()):
        unit, factor = SHOWN[target.axis.units[part.start]]
        above, below = grid[:, column]
        for signal, colour in zip(range(part.start, part.stop), itertools.cycle(_COLOURS), strict=False):
            if kind == "position" and target.gripper.command == "position":
                command = factor * grasp.command_m[keep, signal]
                above.step(time[keep], command, where="post", color=colour, lw=0.6, ls=":")
            above.plot(time[keep], factor * measured[:, signal], ".", color=colour, ms=3, alpha=0.55)
            name = _words(target, signal).removeprefix(kind).strip()
            above.plot(time[keep], factor * predicted[keep, signal], color=colour, lw=1.2, label=name)
            below.plot(time[keep], residual[:, signal], color=colour, lw=0.9)
        _finish(above, f"{kind} [{unit}]")
        _residual_axes(below, target.part)
    above = grid[0, 0]
    above.plot([], [], ".", color=MEASURED, ms=4, label="measured")
    above.plot([], [], color=MEASURED, lw=1.2, label="model")
    above.plot([], [], ":", color=MEASURED, lw=0.8, label="command")
    above.legend(frameon=False, fontsize=8)
    return figure


def dependence(values: dict[str, np.ndarray], residual: np.ndarray, target: Target) -> Figure:
    """Residuals ÷ noise of positions and forces against what they may depend on.

    Args:
      values: covariate → ``(G, S, motors or channels)``; NaN where there is none.
      residual: ``(G, S, C)``.
      target: the measurements.
    """
    mask, kinds = target.mask, target.axis.kinds
    figure = Figure(figsize=(2.3 * len(values), 4.4), layout="constrained")
    grid = figure.subplots(len(kinds), len(values), sharey="row", squeeze=False)
    for column, (name, value) in enumerate(values.items()):
        label, factor = AXES[name]
        for row, (kind, part) in enumerate(kinds.items()):
            axes, errors = grid[row, column], residual[..., part]
            against = of_width(value, errors.shape[-1])
            chosen = mask[..., None] & np.isfinite(against) & np.isfinite(errors)
            x, y = factor * against[chosen], errors[chosen]
            if name == "direction":
                _by_direction(
                    axes,
                    x,
                    y,
                    ("falling", "still", "rising") if target.gripper.is_servo else ("closing", "still", "opening"),
                )
            else:
                _binned(axes, x, y)
                if name == "velocity_m_s":  # most samples are nearly at rest
                    axes.set_xscale("symlog", linthresh=5)
                    axes.set_xticks([-100, 0, 100], ["−100", "0", "100"])
                    axes.set_xticks([], minor=True)
            axes.axhspan(-1, 1, color="0.92", zorder=0)
            axes.axhline(0, color="0.5", lw=0.6)
            _finish(axes, f"{kind} residual ÷ noise" if column == 0 else "")
        grid[-1, column].set_xlabel(label.replace("[mm", f"[{SHOWN[target.axis.units[0]][0]}"))
    for row, part in enumerate(kinds.values()):  # a few outliers must not flatten the rest
        sizes = np.abs(residual[..., part][mask])
        sizes = sizes[np.isfinite(sizes)]
        span = max(3.0, 1.2 * np.quantile(sizes, 0.99)) if len(sizes) else 3.0
        grid[row, 0].set_ylim(-span, span)
    return figure


def symptom(target: Target, index: int, signal: int, without: np.ndarray, having: np.ndarray, effect: str) -> Figure:
    """One signal of one grasp: measured, and predicted without and with an effect; residuals ÷ noise below.

    Args:
      target: the measurements.
      index: of the grasp.
      signal: of the signal.
      without: predicted without the effect, ``(S, C)``.
      having: predicted with it, ``(S, C)``.
      effect: its name.
    """
    grasp = target.grasps[index]
    time, keep = grasp.time_s - grasp.time_s[0], _thin(len(grasp.time_s))
    _, factor = SHOWN[target.axis.units[signal]]
    measured = target.signals[index][keep, signal]
    figure = Figure(figsize=(8.5, 4.8), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(2.2, 1))
    moves = signal < target.axis.positions.stop
    if moves and target.gripper.command == "position":
        command = factor * grasp.command_m[keep, signal]
        above.step(time[keep], command, where="post", color="0.6", lw=0.8, ls=":", label="command")
    above.plot(time[keep], factor * measured, ".", color=MEASURED, ms=4, alpha=0.7, label="measured")
    for predicted, colour, style, word in ((without, WITHOUT, "--", "without"), (having, WITH, "-", "with")):
        above.plot(time[keep], factor * predicted[keep, signal], style, color=colour, lw=1.4, label=f"{word} {effect}")
        residual = (measured - predicted[keep, signal]) / target.sigma[signal]
        below.plot(time[keep], residual, style, color=colour, lw=1)
    _finish(above, _axis(target, signal))
    above.legend(frameon=False, fontsize=9)
    _residual_axes(below, target.part)
    if moves:  # against the whole way of a finger nothing would be seen
        _zoom(above, time, factor * without[: len(time), signal], factor * having[: len(time), signal])
    return figure


def law(added: np.ndarray, before: np.ndarray, after: np.ndarray, target: Target, equation: str) -> Figure:
    """Residuals ÷ noise of positions and forces over what a law adds, and what it changes of the predictions.

    Args:
      added: what the law adds at the samples, ``(G, S, motors or channels)``.
      before: residuals without it, ``(G, S, C)``.
      after: residuals with it, ``(G, S, C)``.
      target: the measurements.
      equation: the law.
    """
    figure = Figure(figsize=(4.2 * len(target.axis.kinds), 3.4), layout="constrained")
    row = figure.subplots(1, len(target.axis.kinds), squeeze=False)[0]
    for axes, (kind, part) in zip(row, target.axis.kinds.items(), strict=True):
        residual, changed = before[..., part], (before - after)[..., part]
        x = of_width(added, residual.shape[-1])[target.mask].ravel()
        _binned(axes, x, residual[target.mask].ravel())
        parts = np.array_split(np.argsort(x, kind="stable"), _BINS)
        y = changed[target.mask].ravel()
        axes.plot([np.median(x[p]) for p in parts], [np.median(y[p]) for p in parts], color=WITH, lw=1.6)
        axes.axhline(0, color="0.5", lw=0.6)
        axes.set_xlabel(equation if len(equation) < 50 else "what the law adds", fontsize=8)
        _finish(axes, f"{kind} residual ÷ noise")
    return figure


def rivals(
    target: Target, time_s: np.ndarray, command_m: np.ndarray, predicted: np.ndarray, names: Sequence[str]
) -> Figure:
    """What two effects predict of one grasp, position and force of the side on which they differ most.

    Args:
      target: whose signals they are.
      time_s: ``(T,)``.
      command_m: ``(T, motors)``.
      predicted: of the two, ``(2, T, C)``.
      names: of the two.
    """
    apart = (predicted[0] - predicted[1]) / target.sigma
    side = max(target.axis.sides, key=lambda side: float(np.sum(apart[:, side] ** 2)))
    figure = Figure(figsize=(9.5, 4.4), layout="constrained")
    grid = figure.subplots(2, len(side), sharex=True, height_ratios=(2.2, 1), squeeze=False)
    for column, signal in enumerate(side):
        _, factor = SHOWN[target.axis.units[signal]]
        above, below = grid[:, column]
        if column == 0:
            above.step(
                time_s, factor * command_m[:, signal], where="post", color="0.6", lw=0.8, ls=":", label="command"
            )
        for signals, colour, style, name in zip(predicted, (LEFT, RIGHT), ("-", "--"), names, strict=True):
            above.plot(time_s, factor * signals[:, signal], style, color=colour, lw=1.4, label=f"if {name}")
        below.plot(time_s, apart[:, signal], color=SECOND, lw=1)
        _finish(above, _axis(target, signal))
        _residual_axes(below, target.part, "difference ÷ noise")
    grid[0, 0].legend(frameon=False, fontsize=8)
    return figure


def steps(target: Target, index: int, signal: int) -> Figure:
    """Readings of one signal of one grasp around its fastest change, with lines at the multiples of their step."""
    grasp, quantum = target.grasps[index], target.quantum[signal]
    _, factor = SHOWN[target.axis.units[signal]]
    values, time = target.signals[index, : len(grasp.time_s), signal], grasp.time_s - grasp.time_s[0]
    middle = int(np.argmax(np.abs(np.gradient(values)))) if len(values) > 1 else 0
    shown = slice(max(0, middle - 25), middle + 26)
    part = values[shown]
    figure = Figure(figsize=(8.5, 3.2), layout="constrained")
    axes = figure.subplots()
    first, last = np.floor(part.min() / quantum), np.ceil(part.max() / quantum)
    for multiple in np.linspace(first, last, min(60, int(last - first) + 1)).round():
        axes.axhline(factor * quantum * multiple, color="0.88", lw=0.7, zorder=0)
    axes.plot(time[shown], factor * part, ".", color=MEASURED, ms=5)
    axes.set_xlabel(f"time in {target.part} [s]")
    _finish(axes, _axis(target, signal))
    return figure


def intervals(rows: Sequence[tuple[str, float, float, float]]) -> Figure:
    """Where fitted parameters lie between their bounds, 0 to 1, with their 95 % intervals: (name, value, low, high)."""
    figure = Figure(figsize=(7.5, 1.0 + 0.27 * len(rows)), layout="constrained")
    axes = figure.subplots()
    for place, (_, value, low, high) in enumerate(rows):
        axes.plot([0, 1], [place, place], color="0.9", lw=5, solid_capstyle="butt", zorder=0)
        at_bound = value < 1e-3 or value > 1 - 1e-3
        colour = WITHOUT if at_bound or high - low > 0.5 else WITH
        axes.plot([low, high], [place, place], color=colour, lw=2)
        axes.plot(value, place, "o", color=colour, ms=5)
    axes.set_yticks(range(len(rows)), [plain(name, 48) for name, *_ in rows], fontsize=8)
    axes.invert_yaxis()
    axes.set_xlim(-0.02, 1.02)
    axes.set_xticks([0, 0.5, 1], ["lower bound", "", "upper bound"])
    axes.spines[:].set_visible(False)
    axes.tick_params(length=0)
    return figure


class Forest(NamedTuple):
    """A panel of :func:`forest`."""

    title: str
    values: Mapping[str, Fitted]  #: by set
    shared: Fitted | None  #: of all sets, if there is one
    differs: bool


def forest(panels: Sequence[Forest]) -> Figure:
    """Values of parameters in several sets with their intervals, a panel for each parameter."""
    lines = -(-len(panels) // 2)
    most = max((len(one.values) for one in panels), default=0) + 1
    figure = Figure(figsize=(8.5, lines * (0.75 + 0.2 * most)), layout="constrained")
    for place, (title, values, shared, differs) in enumerate(panels, 1):
        axes = figure.add_subplot(lines, 2, place)
        drawn = [(name, fitted, "o", WITHOUT if differs else WITH) for name, fitted in values.items()]
        drawn += [("all", shared, "D", MEASURED)] if shared else []
        for row, (_, fitted, marker, colour) in enumerate(drawn):
            axes.plot([fitted.low, fitted.high], [row, row], color=colour, lw=2)
            axes.plot(fitted.value, row, marker, color=colour, ms=5)
        axes.set_yticks(range(len(drawn)), [plain(name, 20) for name, *_ in drawn], fontsize=8)
        axes.set_ylim(len(drawn) - 0.4, -0.6)
        axes.set_title(plain(title, 48) + (" – differs" if differs else ""), fontsize=9, loc="left")
        axes.tick_params(axis="x", labelsize=8)
        axes.locator_params(axis="x", nbins=5)
        _finish(axes, "")
    return figure


def falls(rows: Sequence[tuple[str, float, float]]) -> Figure:
    """Errors ÷ noise before and after, as pairs of bars: (name, before, after)."""
    figure = Figure(figsize=(7.5, 1.0 + 0.34 * len(rows)), layout="constrained")
    axes = figure.subplots()
    for place, (_, before, after) in enumerate(rows):
        axes.barh(place - 0.18, before, 0.34, color=WITHOUT, label="without" if place == 0 else None)
        axes.barh(place + 0.18, after, 0.34, color=WITH, label="with" if place == 0 else None)
    axes.axvline(1, color=MEASURED, lw=0.9, ls=":")
    axes.set_yticks(range(len(rows)), [plain(name) for name, *_ in rows], fontsize=9)
    axes.invert_yaxis()
    axes.set_xlabel("held-out error ÷ sensor noise (dotted: noise alone)")
    _finish(axes, "")
    axes.legend(frameon=False, fontsize=9)
    return figure


def _words(target: Target, signal: int) -> str:
    name = target.axis.names[signal]
    return NAMES.get(name, name)


def _axis(target: Target, signal: int) -> str:
    return f"{_words(target, signal)} [{SHOWN[target.axis.units[signal]][0]}]"


def _thin(count: int) -> slice:
    return slice(0, count, max(1, -(-count // _POINTS)))


def _finish(axes: Axes, ylabel: str) -> None:
    axes.set_ylabel(ylabel)
    axes.spines[["top", "right"]].set_visible(False)


def _residual_axes(axes: Axes, part: str, ylabel: str = "residual ÷ noise") -> None:
    axes.axhspan(-2, 2, color="0.92", zorder=0)
    axes.axhline(0, color="0.5", lw=0.6)
    axes.set_xlabel(f"time in {part} [s]")
    _finish(axes, ylabel)


def _zoom(axes: Axes, time: np.ndarray, one: np.ndarray, other: np.ndarray) -> None:
    """Limits the axes to where two curves part."""
    apart = np.abs(one - other)
    where = np.flatnonzero(apart > 0.15 * apart.max()) if len(apart) else []
    if len(where) < 2:
        return
    first, last = time[where[0]] - 0.3, time[where[-1]] + 0.3
    both = np.concatenate([curve[(time >= first) & (time <= last)] for curve in (one, other)])
    margin = max(0.15 * np.ptp(both), 3 * apart.max())
    axes.set_xlim(max(first, time[0]), min(last, time[-1]))
    axes.set_ylim(both.min() - margin, both.max() + margin)


def _binned(axes: Axes, x: np.ndarray, y: np.ndarray) -> None:
    """Some of the points, and of equally filled bins the median and the middle 80 %."""
    if len(x) < 2 * _BINS:
        axes.plot(x, y, ".", color=MEASURED, ms=2)
        return
    some = np.random.default_rng(0).permutation(len(x))[:_DOTS]
    axes.plot(x[some], y[some], ".", color="0.65", ms=1.5)
    parts = np.array_split(np.argsort(x, kind="stable"), _BINS)
    centre = [np.median(x[part]) for part in parts]
    low, middle, high = np.transpose([np.quantile(y[part], (0.1, 0.5, 0.9)) for part in parts])
    axes.fill_between(centre, low, high, color=SECOND, alpha=0.25, lw=0)
    axes.plot(centre, middle, color=SECOND, lw=1.6)


def _by_direction(axes: Axes, x: np.ndarray, y: np.ndarray, words: Sequence[str]) -> None:
    for place in (-1, 0, 1):
        inside = y[x == place]
        if len(inside):
            low, middle, high = np.quantile(inside, (0.1, 0.5, 0.9))
            axes.plot([place, place], [low, high], color=SECOND, alpha=0.25, lw=9, solid_capstyle="butt")
            axes.plot(place, middle, "o", color=SECOND, ms=5)
    axes.set_xlim(-1.6, 1.6)
    axes.set_xticks([-1, 0, 1], words, fontsize=8)
