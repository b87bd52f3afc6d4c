"""The pictures: force traces against their goals, and the paper's box plot of rewards over softness."""

from __future__ import annotations

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from tensordict import TensorDictBase

from forcegrasp.evaluate.colours import finger_colours, policy_colours
from forcegrasp.physics import default_gripper

matplotlib.use("Agg")
GOAL = "#444444"


def _draw_forces(axes: Axes, episode: TensorDictBase, colour: str, period_s: float) -> None:
    after, shades = episode.get("next"), finger_colours(colour)
    time = np.arange(1, len(after["force"]) + 1) * period_s
    for read, shade in zip(after["sensed_force"].T, shades, strict=False):
        axes.plot(time, read, color=shade, lw=0.6, alpha=0.4)
    for force, shade, name in zip(after["force"].T, shades, ("left", "right"), strict=True):
        axes.plot(time, force, color=shade, lw=1.4, label=name)
    axes.axhline(float(after["goal_force"][0]), color=GOAL, ls="--", lw=1, label="goal")
    axes.set_xlim(0, time[-1])


def force_traces(episodes: TensorDictBase, title: str, colour: str, period_s: float | None = None) -> Figure:
    """Whole forces of up to six episodes ``(n, T)`` against their goals; thin lines are the noisy readings.

    Args:
      episodes: as an env's ``rollout`` gives them.
      title: whose they are.
      colour: of that policy; the right finger has another shade of it.
      period_s: seconds per step; the paper's by default.
    """
    period_s = period_s or default_gripper().period_s
    n = min(6, len(episodes))
    rows = (n + 2) // 3
    figure = Figure(figsize=(10, 2.7 * rows + 0.5), layout="constrained")
    grid = figure.subplots(rows, min(n, 3), squeeze=False).reshape(-1)
    for axes, episode in zip(grid, episodes, strict=False):
        _draw_forces(axes, episode, colour, period_s)
        kappa, _, radius, offset, goal = episode["grasp_parameters"][0].tolist()
        grasp = f"κ {kappa:.2f} · r {radius * 1e3:.0f} mm · o_y {offset * 1e3:+.0f} mm"
        overshoot = max(0.0, float(episode["next", "force"].max()) / goal - 1)
        axes.set_title(f"{grasp}\novershoot {overshoot:.0%} of the goal", fontsize=9)
        axes.set_xlabel("time [s]")
        axes.set_ylabel("force [N]")
    for axes in grid[n:]:
        axes.remove()
    grid[0].legend(fontsize=8, loc="upper right")
    figure.suptitle(title.replace("$", r"\$"))  # no mathematics in it
    return figure


def figure_pixels(figure: Figure) -> np.ndarray:
    """A figure as an RGB array, ``(height, width, 3)`` bytes."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()


def cell_boxes(results: dict[str, np.ndarray], cells: list[str], xlabel: str, ylabel: str, log: bool = False) -> Figure:
    """Box plot of a figure per cell (softness value, or object) and policy, as in the paper's Fig. 2 (left).

    Args:
      results: policy → values, ``(cells, trials)``.
      cells: their names.
      xlabel: what the cells differ in.
      ylabel: what the values are.
      log: whether the values span orders of magnitude.
    """
    figure = Figure(figsize=(max(8, 0.9 * len(cells)), 4.2), layout="constrained")
    axes = figure.subplots()
    width = 0.8 / len(results)
    handles, colours = [], policy_colours(results)
    for index, (name, values) in enumerate(results.items()):
        colour = colours[name]
        places = np.arange(len(cells)) + (index + 0.5) * width - 0.4
        boxes = axes.boxplot(
            list(values),
            positions=places,
            widths=0.85 * width,
            patch_artist=True,
            flierprops={"marker": ".", "markersize": 3, "markeredgecolor": colour},
            medianprops={"color": "black", "lw": 1},
            boxprops={"facecolor": colour, "lw": 0.6},
            whiskerprops={"lw": 0.6},
            capprops={"lw": 0.6},
        )
        handles.append(boxes["boxes"][0])
    axes.set_xticks(np.arange(len(cells)), cells)
    axes.set_xlim(-0.5, len(cells) - 0.5)
    axes.set_xlabel(xlabel)
    axes.set_ylabel(ylabel)
    axes.grid(axis="y", alpha=0.3)
    if log:
        axes.set_yscale("log")
    axes.legend(handles, list(results), fontsize=9, loc="lower left", bbox_to_anchor=(0, 1), ncols=4, frameon=False)
    return figure
