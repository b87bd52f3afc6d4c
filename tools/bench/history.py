"""How the ratios of a run compare with those of earlier commits on the same machine."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from forcegrasp.runs.provenance import git_hash
from tools.bench.results import ENGINE, Results

#: By this share a ratio may fall from one commit to the next: as much as two runs of the same code differ.
MOST_LOST = 0.1


def entry(results: Results) -> dict[str, Any] | None:
    """Commit, machine, and each layer's frames/s ÷ those of the raw engine of the same run; None without any."""
    ratios = {
        f"{found.case.name}, {found.case.tier}": round(share, 4)
        for found in results.levels
        if (share := results.share_of_engine(found)) and found.case.name != ENGINE
    }
    if not ratios:
        return None
    grasps = results.levels[0].case.grasps
    return {"commit": git_hash() or "none", "machine": results.machine, "grasps": grasps, "ratios": ratios}


def lost(history: list[dict[str, Any]]) -> list[str]:
    """Which ratios of the newest entry are more than 10 % below those of the last other commit on its machine."""
    if not history:
        return []
    newest = history[-1]
    before = [one for one in history[:-1] if _comparable(one, newest) and one["commit"] != newest["commit"]]
    if not before:
        return []
    earlier, commit = before[-1]["ratios"], before[-1]["commit"]
    return [
        f"{name}: {ratio:.2f} of the raw engine, {earlier[name]:.2f} at {commit[:12]}"
        for name, ratio in newest["ratios"].items()
        if ratio < (1 - MOST_LOST) * earlier.get(name, 0.0)
    ]


def _comparable(one: dict[str, Any], other: dict[str, Any]) -> bool:
    return all(one[key] == other[key] for key in ("machine", "grasps"))


def draw_history(history: list[dict[str, Any]], path: Path) -> None:
    """A line for each layer over the commits that were measured on the newest entry's machine."""
    shown = [one for one in history if _comparable(one, history[-1])]
    figure = Figure(figsize=(7.5, 4.2), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    for name in dict.fromkeys(name for one in shown for name in one["ratios"]):
        points = [(place, one["ratios"][name]) for place, one in enumerate(shown) if name in one["ratios"]]
        axes.plot(*zip(*points, strict=True), "o-", label=name)
    axes.set_xticks(range(len(shown)), [one["commit"][:7] for one in shown], rotation=45)
    axes.set_ylim(0, 1.05)
    axes.set_xlabel("commit")
    axes.set_ylabel("frames/s ÷ those of the raw engine")
    axes.grid(alpha=0.25)
    axes.legend(fontsize=8, frameon=False)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110, metadata={"Software": ""})
