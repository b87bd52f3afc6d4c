"""One grasp on paper: forces against the goal, the object's displacement, and when which finger touched."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from tensordict import TensorDictBase

from forcegrasp.config import SensorConfig
from forcegrasp.env.episodes import summarise
from forcegrasp.evaluate.colours import finger_colours, policy_colours
from forcegrasp.evaluate.grasp_layout import BOTTOM_EDGE, HEIGHT, LEFT_EDGE, RIGHT_EDGE, TOP_EDGE, WIDTH
from forcegrasp.evaluate.plots import GOAL
from forcegrasp.physics import default_gripper
from forcegrasp.physics.completion import complete


def draw_grasps(
    episodes: dict[str, TensorDictBase],
    sensors: SensorConfig,
    colours: dict[str, str] | None = None,
    period_s: float | None = None,
) -> list[Figure]:
    """A picture per policy, title → whole episode ``(T,)``, all on one scale. Without ``colours`` titles are names."""
    colours = colours or policy_colours(episodes)
    figures = [draw_grasp(episode, name, sensors, colours[name], period_s) for name, episode in episodes.items()]
    for alike in zip(*(figure.axes for figure in figures), strict=True):
        lows, highs = zip(*(axes.get_ylim() for axes in alike), strict=True)
        for axes in alike:
            axes.set_ylim(min(lows), max(highs))
    return figures


def draw_grasp(
    episode: TensorDictBase, name: str, sensors: SensorConfig, colour: str, period_s: float | None = None
) -> Figure:
    """Draws a whole episode ``(T,)`` of a policy called ``name`` in its colour, with room for the scene."""
    period_s = period_s or default_gripper().period_s
    figure = Figure(figsize=(WIDTH / 100, HEIGHT / 100), dpi=100)
    span = (RIGHT_EDGE - LEFT_EDGE) / WIDTH
    height = BOTTOM_EDGE - TOP_EDGE
    forces = figure.add_axes((LEFT_EDGE / WIDTH, 1 - (TOP_EDGE + 0.66 * height) / HEIGHT, span, 0.66 * height / HEIGHT))
    moved = figure.add_axes((LEFT_EDGE / WIDTH, 1 - BOTTOM_EDGE / HEIGHT, span, 0.27 * height / HEIGHT), sharex=forces)
    _draw_forces(forces, episode, sensors, colour, period_s)
    _draw_displacement(moved, episode, colour, period_s)
    _mark_phases(forces, moved, episode, sensors, period_s)
    figure.text(0.012, 0.975, name, fontsize=12, weight="bold", va="top")
    figure.text(0.988, 0.968, describe(episode), fontsize=9, va="top", ha="right")
    return figure


def describe(episode: TensorDictBase) -> str:
    """The grasp of an episode ``(T,)``, in a line."""
    kappa, b2, radius, offset, goal = episode["grasp_parameters"][0].tolist()
    return (
        f"softness κ {kappa:.2f} · radius {radius * 1e3:.1f} mm · offset {offset * 1e3:+.1f} mm"
        f" · goal {goal:.2f} N · b₂ {b2:.3g}"
    )


def from_the_start(episode: TensorDictBase, key: str) -> np.ndarray:
    """An entry before the first step and after every one, ``(T + 1, ...)``."""
    return np.concatenate([episode.get(key)[:1].numpy(), episode.get(("next", key)).numpy()])


def _draw_forces(axes: Axes, episode: TensorDictBase, sensors: SensorConfig, colour: str, period_s: float) -> None:
    force, read = from_the_start(episode, "force"), from_the_start(episode, "sensed_force")
    time, shades = np.arange(len(force)) * period_s, finger_colours(colour)
    goal = float(episode["goal_force"][0])
    band = 2 * complete(sensors, default_gripper()).force_std_n
    axes.axhspan(goal - band, goal + band, color=GOAL, alpha=0.13, lw=0, label="± 2 σ_f")
    axes.axhline(goal, color=GOAL, ls="--", lw=1, label="goal")
    for channel, shade in zip(read.T, shades, strict=False):
        axes.plot(time, channel, color=shade, lw=0.6, alpha=0.35)
    for one, shade, name in zip(force.T, shades, ("left", "right"), strict=True):
        axes.plot(time, one, color=shade, lw=1.6, label=name)
    top = max(goal + band, float(read.max()), float(force.max()))
    axes.set_ylim(min(-0.04 * top, float(read.min())), 1.22 * top)
    axes.set_xlim(0, time[-1])
    axes.set_ylabel("force [N]", fontsize=9)
    axes.tick_params(labelbottom=False, labelsize=8)
    axes.legend(fontsize=8, loc="lower right", ncols=2, framealpha=0.8)


def _draw_displacement(axes: Axes, episode: TensorDictBase, colour: str, period_s: float) -> None:
    position = from_the_start(episode, "object_position")[:, 0]
    moved = (position - position[0]) * 1e3
    axes.plot(np.arange(len(moved)) * period_s, moved, color=colour, lw=1.6)
    axes.axhline(0, color=GOAL, lw=0.6, alpha=0.6)
    low, high = min(float(moved.min()), -0.05), max(float(moved.max()), 0.05)  # a few µm must not look like much
    axes.set_ylim(low - 0.1 * (high - low), high + 0.1 * (high - low))
    axes.set_ylabel("moved [mm]", fontsize=9)
    axes.set_xlabel("time [s]", fontsize=9, labelpad=1)
    axes.tick_params(labelsize=8)


def _mark_phases(forces: Axes, moved: Axes, episode: TensorDictBase, sensors: SensorConfig, period_s: float) -> None:
    sensors = complete(sensors, default_gripper())
    metrics = summarise(episode[None], sensors, period_s)
    end = len(episode) * period_s
    top = 1.0
    for metric, text in (("first_contact_s", "first contact"), ("both_contact_s", "both in contact")):
        time = float(metrics[metric][0])
        if time >= end:
            continue
        for axes in (forces, moved):
            axes.axvline(time, color="#777777", lw=0.9, ls=":")
        late = time > 0.7 * end
        place = (time + (-0.01 if late else 0.01) * end, top - 0.02)
        forces.text(
            *place,
            text,
            fontsize=8,
            va="top",
            ha="right" if late else "left",
            color="#444444",
            transform=forces.get_xaxis_transform(),
        )
        top -= 0.08  # the two may be close to each other
