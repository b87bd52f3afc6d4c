"""What was found, as pictures: bars of frames per second, curves of growth, learning curves over time."""

from __future__ import annotations

from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullLocator, StrMethodFormatter

from tools.bench.case import Measured
from tools.bench.peers import rival
from tools.bench.results import ENGINE, Results

THOUSANDS = StrMethodFormatter("{x:,.0f}")
#: Okabe and Ito's, as in the project's other pictures: of bars, of trainings, of the levels as they grow.
COLOURS = {"fast": "#0072b2", "reference": "#56b4e9", "peer": "#d55e00"}
TRAININGS = (*COLOURS.values(), "#e69f00")
LINES = ("#999999", "#000000", "#e69f00", "#009e73", "#56b4e9", "#0072b2")


def draw(results: Results, path: Path) -> list[Path]:
    """Writes ``path``, and ``NAME_learning`` beside it if there was a training; returns what was written."""
    pictures: dict[Path, Figure] = {}
    if results.levels or results.peers:
        pictures[path] = _speed(results)
    if results.learning:
        pictures[path.with_stem(f"{path.stem}_learning")] = _learning(results)
    path.parent.mkdir(parents=True, exist_ok=True)
    for where, figure in pictures.items():
        FigureCanvasAgg(figure)
        figure.savefig(where, dpi=110, metadata={"Software": ""})
    return list(pictures)


def _speed(results: Results) -> Figure:
    growth = [("grasps", results.by_grasps), ("threads", results.by_threads)]
    growth = [(axis, measured) for axis, measured in growth if measured]
    figure = Figure(figsize=(12 if growth else 7.5, 7), layout="constrained")
    if not growth:
        _bars(figure.subplots(), results)
        return figure
    panels = figure.subplot_mosaic([["bars", axis] for axis, _ in growth], width_ratios=[1.35, 1])
    _bars(panels["bars"], results)
    for axis, measured in growth:
        _growth(panels[axis], measured, axis)
    return figure


def _bars(axes: Axes, results: Results) -> None:
    """A bar for each level and peer, longest first; peers say how many times as fast the like of ours is."""
    bars = [*results.levels, *results.peers]
    longest = max(found.steps_per_second for found in bars)
    shortest = min(found.steps_per_second for found in bars)
    for row, found in enumerate(bars):
        rate, case, is_peer = found.steps_per_second, found.case, found in results.peers
        axes.barh(row, rate, color=COLOURS["peer" if is_peer else case.tier], height=0.72)
        axes.text(rate * 1.06, row, f"{rate:,.0f}{_remark(results, found, is_peer)}", va="center", fontsize=8)
    axes.set_yticks(range(len(bars)), [f"{found.case.name}, {found.case.tier}" for found in bars], fontsize=8)
    axes.invert_yaxis()
    axes.set_xscale("log")
    axes.set_xlim(shortest / 2, longest * (longest / shortest) ** 0.75)  # room for the remarks
    powers = [10.0**power for power in range(10) if shortest / 2 < 10**power < longest]
    axes.xaxis.set_major_locator(FixedLocator(powers))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(THOUSANDS)
    axes.set_xlabel("frames (control steps of a grasp) per second")
    axes.set_title(
        f"{results.levels[0].case.grasps if results.levels else 0} grasps at once; other stacks: {results.processes} "
        f"processes\n{results.machine.get('cores', '?')} cores",
        fontsize=10,
    )
    axes.spines[["top", "right"]].set_visible(False)


def _remark(results: Results, found: Measured, is_peer: bool) -> str:
    case = found.case
    if not is_peer:
        share = results.share_of_engine(found)
        return f"  ({share:.0%} of the engine)" if share and case.name != ENGINE else ""
    fast, same = results.rate(rival(case.name), "fast"), results.rate(rival(case.name), case.tier)
    if not fast or not same:
        return ""
    times = fast / found.steps_per_second
    return f"  (ours: {times:.1f} ×, of it stack {same / found.steps_per_second:.1f}, tier {fast / same:.1f})"


def _growth(axes: Axes, measured: list[Measured], axis: str) -> None:
    counts = sorted({getattr(found.case, axis) for found in measured})
    names = dict.fromkeys(found.case.name for found in measured)
    for number, (name, colour) in enumerate(zip(names, LINES, strict=False)):
        points = sorted((getattr(m.case, axis), m.steps_per_second) for m in measured if m.case.name == name)
        axes.plot(
            *zip(*points, strict=True), "o-", color=colour, label=name, ms=8 - number, lw=3 - 0.3 * number
        )  # lines that lie on each other are all seen
    axes.set_xscale("log")
    axes.xaxis.set_major_locator(FixedLocator(counts))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.set_xticklabels(list(map(str, counts)))
    axes.set_ylim(0)
    axes.yaxis.set_major_formatter(THOUSANDS)
    axes.set_ylabel("frames per second")
    tier, grasps = measured[0].case.tier, measured[0].case.grasps
    detail = "grasps at once" if axis == "grasps" else f"threads of the physics, {grasps} grasps"
    axes.set_xlabel(f"{detail}, {tier} physics")
    axes.grid(alpha=0.25)
    if axis == "grasps":
        axes.legend(fontsize=8, frameon=False)


def _learning(results: Results) -> Figure:
    figure = Figure(figsize=(7.5, 4.2), layout="constrained")
    axes = figure.subplots()
    goal = results.learning[0].goal
    for one, colour in zip(results.learning, TRAININGS, strict=False):
        reached = one.reached
        verdict = f"{reached[0]:,.0f} s" if reached else f"not in {one.limit_s:,.0f} s, best {one.best:.0f}"
        seconds, _, rewards = zip(*one.curve, strict=True) if one.curve else ((), (), ())
        axes.plot(seconds, rewards, color=colour, lw=1.5, label=f"{one.name}, {one.tier} physics: {verdict}")
        if reached:
            axes.plot(reached[0], reached[2], "o", color=colour)
    axes.axhline(goal, color="#444444", ls="--", lw=1)
    axes.set_xscale("log")
    axes.set_xlim(1, 1.1 * max(one.reached[0] if one.reached else one.limit_s for one in results.learning))
    axes.xaxis.set_major_formatter(THOUSANDS)
    axes.set_xlabel("seconds of training")
    axes.set_ylabel("force reward of training episodes (of 150)")
    axes.grid(alpha=0.25)
    axes.legend(fontsize=9, frameon=False, loc="upper left")
    axes.set_ylim(0, max(goal, *(one.best for one in results.learning)) * 1.3)
    return figure
