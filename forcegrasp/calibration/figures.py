"""Pictures of the calibrations, as in the paper's appendix. Each takes closings and says what varied between them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from forcegrasp.calibration.rig import Closing
from forcegrasp.calibration.staircase import Staircase

mpl.use("Agg")
#: From low to high values: colours of Okabe and Ito, distinct to the colour-blind.
COLOURS = ("#0072b2", "#56b4e9", "#009e73", "#e69f00", "#d55e00", "#cc79a7")
# A touch, for the figures: less than any sensor shows.
_TOUCH_N = 1e-3


def draw_power_grasps(closing: Closing, labels: Sequence[str], measured: tuple | None = None) -> Figure:
    """Position and speed over time of several power grasps, one label each.

    Args:
      closing: n closings.
      labels: n of them.
      measured: times ``(T,)`` and positions ``(T,)`` of a real one, metres, on the clock of the first command.
    """
    figure, (left, right) = _panels()
    period = max(1, round(0.04 / (closing.time_s[1] - closing.time_s[0])))
    for position, label, colour in zip(closing.position_m.mean(axis=2), labels, _colours(len(labels)), strict=True):
        left.plot(closing.time_s, 1e3 * position, color=colour, label=label)
        # over one command's time, for the speed ripples with the commands
        speed = (position[:-period] - position[period:]) / (closing.time_s[period] - closing.time_s[0])
        right.plot(closing.time_s[period:], 1e3 * speed, color=colour)
    if measured is not None:
        left.plot(measured[0], 1e3 * np.asarray(measured[1]), ".", color="0.2", ms=3, label="measured")
    for axes, name in ((left, "position q [mm]"), (right, "closing speed [mm/s]")):
        axes.set_xlabel("time since the first command [s]")
        axes.set_ylabel(name)
        axes.set_xlim(0, closing.time_s[-1])
        axes.set_ylim(bottom=0)
    left.legend(frameon=False, fontsize=9)
    return figure


def draw_presses(closing: Closing, labels: Sequence[str]) -> Figure:
    """Force over time since the touch, and over the way pressed since then, of several closings."""
    figure, (left, right) = _panels()
    force, position = closing.force_n.mean(axis=2), closing.position_m.mean(axis=2)
    for f, q, label, colour in zip(force, position, labels, _colours(len(labels)), strict=True):
        touch = max(int(np.argmax(f > _TOUCH_N)) - 1, 0)
        left.plot(closing.time_s[touch:] - closing.time_s[touch], f[touch:], color=colour, label=label)
        right.plot(1e3 * (q[touch] - q[touch:]), f[touch:], color=colour, marker=".", ms=3, lw=1)
    left.set_xlabel("time since the touch [s]")
    right.set_xlabel("way since the touch [mm]")
    left.set_xlim(0, 0.5)
    for axes in (left, right):
        axes.set_ylabel("force f, mean of both fingers [N]")
        axes.set_ylim(bottom=0)
    right.set_xlim(left=0)
    left.legend(frameon=False, fontsize=9, loc="lower right")
    return figure


def draw_staircase(stairs: Staircase, labels: Sequence[str], real: Mapping[str, tuple] | None = None) -> Figure:
    """Final forces over commanded delta with their regressions.

    Args:
      stairs: of the simulator.
      labels: one per object.
      real: name → deltas, final forces ``(d,)`` and slope in N/m of a real gripper; the line of that slope is drawn
        through the mean of its points.
    """
    figure = Figure(figsize=(6.6, 4.4), layout="constrained")
    axes = figure.subplots()
    reach = np.array([0.0, stairs.delta_m.max()])
    for force, slope, label, colour in zip(stairs.force_n, stairs.slopes, labels, _colours(len(labels)), strict=True):
        axes.plot(1e3 * stairs.delta_m, force, "o", ms=4, color=colour, label=f"{label}: {slope.n_per_m:.0f} N/m")
        axes.plot(1e3 * reach, slope.offset_n + slope.n_per_m * reach, color=colour, lw=1)
    for (name, (delta, force, slope)), marker in zip((real or {}).items(), "xs^v" * 9, strict=False):
        delta, force = np.asarray(delta), np.asarray(force)
        line = np.mean(force) + slope * (reach - np.mean(delta))
        axes.plot(1e3 * delta, force, marker, ms=6, mfc="none", color="black", label=f"{name}, robot: {slope:.0f} N/m")
        axes.plot(1e3 * reach, line, color="black", lw=1, ls="--")
    axes.set_xlim(left=0)
    axes.set_ylim(bottom=0)
    axes.set_xlabel("commanded Δq [mm]")
    axes.set_ylabel("final force f(T) [N]")
    axes.legend(frameon=False, fontsize=9)
    axes.spines[["top", "right"]].set_visible(False)
    return figure


def _panels() -> tuple[Figure, tuple[Axes, Axes]]:
    figure = Figure(figsize=(9, 3.4), layout="constrained")
    panels = figure.subplots(1, 2)
    for axes in panels:
        axes.spines[["top", "right"]].set_visible(False)
        axes.grid(alpha=0.25)
    return figure, panels


def _colours(n: int) -> list[str]:
    """n colours, as far apart as there are."""
    few = {1: (0,), 2: (0, 4), 3: (0, 2, 4), 4: (0, 2, 3, 4)}.get(n)
    return [COLOURS[k] for k in few] if few else [COLOURS[k % len(COLOURS)] for k in range(n)]
