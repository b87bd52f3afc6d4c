"""What the reports' view shows: errors of each grasp in each phase, and signals as measured and as predicted."""

from __future__ import annotations

from typing import Any

import numpy as np

from forcegrasp.identify.target import Target
from forcegrasp.reports import figures
from forcegrasp.reports.html import Section, View

# Signals are rounded to this share of their noise: nobody sees it, and whole numbers are short.
_ROUNDING = 0.05
# Numbers that a report holds at most, about 5 bytes each; of longer recordings every other sample is kept, or fewer.
_MOST_NUMBERS = 500_000


def view_section(target: Target, predicted: dict[str, np.ndarray], by_error: bool = False) -> Section:
    """The section of a report in which a reader picks a grasp, a signal and a stretch of time.

    Args:
      target: the measurements.
      predicted: name of a model → its signals, ``(G, S, C)``; the one that the answer is about last.
      by_error: whether the worst grasps come first at first.
    """
    return Section(f"Look at the {target.part}s", [View(view_data(target, predicted) | {"by_error": by_error})])


def view_data(target: Target, predicted: dict[str, np.ndarray]) -> dict[str, Any]:
    """All that ``view.js`` reads, in plain types: errors ÷ noise, and signals in whole multiples of ``steps``."""
    axis, sigma = target.axis, target.sigma
    steps = _ROUNDING * sigma
    residuals = [target.residual(signals) for signals in predicted.values()]
    commands = len(target.gripper.motors) if target.gripper.command == "position" else 0
    numbers = sum(len(grasp.time_s) for grasp in target.grasps) * (1 + (1 + len(predicted)) * len(axis) + commands)
    every = max(1, -(-numbers // _MOST_NUMBERS))
    parts = []
    for index, grasp in enumerate(target.grasps):
        kept = slice(0, len(grasp.time_s), every)
        command = [_whole(grasp.command_m[kept, k], steps[k]) for k in range(commands)]
        parts.append({
            "name": grasp.label,
            "errors": [_errors(residual[[index]], target.phase[[index]]) for residual in residuals],
            "spans": _spans(target.phase[index, : len(grasp.time_s)], grasp.time_s - grasp.time_s[0]),
            "time": np.round(grasp.time_s[kept] - grasp.time_s[0], 5).tolist(),
            "measured": _channels(target.signals[index][: len(grasp.time_s)][kept], steps),
            "predicted": [_channels(p[index][: len(grasp.time_s)][kept], steps) for p in predicted.values()],
            "command": command,
        })  # fmt: skip
    shown = [figures.SHOWN[unit] for unit in axis.units]
    return {
        "part": target.part,
        "phases": [phase.replace("_", " ") for phase in target.phases],
        "models": list(predicted),
        "signals": [
            {"name": figures.NAMES.get(name, name), "unit": unit, "step": float(factor * step)}
            for name, (unit, factor), step in zip(axis.names, shown, steps, strict=True)
        ],
        "sides": [axis.side_of(k) for k in range(len(axis))],
        "noise": _ROUNDING,
        "every": every,
        "errors": [_errors(residual, target.phase) for residual in residuals],
        "parts": parts,
    }


def _errors(residual: np.ndarray, phase: np.ndarray) -> list[list[float | None]]:
    """rms residual ÷ noise of each signal in each phase; None where there is none. ``(G, S, C)`` and ``(G, S)``."""
    found = []
    for k in range(residual.shape[-1]):
        inside = [residual[..., k][phase == index] for index in range(max(0, int(phase.max())) + 1)]
        found.append([round(float(np.sqrt(np.mean(i**2))), 2) if len(i) else None for i in inside])
    return found


def _spans(phase: np.ndarray, time: np.ndarray) -> list[tuple[int, float, float]]:
    """Phase, first and last time of each stretch; phase −1 does not count."""
    starts = np.flatnonzero(np.diff(phase, prepend=-2))
    ends = np.append(starts[1:], len(phase) - 1)
    return [
        (int(phase[s]), round(float(time[s]), 4), round(float(time[e]), 4)) for s, e in zip(starts, ends, strict=True)
    ]


def _channels(signals: np.ndarray, steps: np.ndarray) -> list[list[int]]:
    """Signals ``(S, C)`` as whole multiples of a step each, channel by channel."""
    return [_whole(signals[:, k], step) for k, step in enumerate(steps)]


def _whole(values: np.ndarray, step: float) -> list[int]:
    return np.rint(values / step).astype(int).tolist()
