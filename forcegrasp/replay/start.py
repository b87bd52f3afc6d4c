"""Where motors stand when the log of a grasp begins."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from forcegrasp.measure import MeasuredGrasp
from forcegrasp.measure.rounding import find_step
from forcegrasp.measure.white_noise import white_noise

# A motor starts where its first command or the end of its range is, if measured so near to it. Share of its stroke.
_AT_REST = 1 / 45
# It was not at rest if the encoder leaves its first reading by so many times its noise while the first command is held,
# which must be for so many samples.
_MOVED, _HELD = 4.0, 6


def encoder_noise(grasps: Sequence[MeasuredGrasp]) -> np.ndarray:
    """Standard deviation of encoders, m or rad, ``(motors,)``.

    Readings that are rounded are off by as much as rounding makes them, at least.
    """
    third = np.concatenate([np.diff(grasp.position_m, n=3, axis=0) for grasp in grasps])
    if not len(third):
        return np.zeros(third.shape[1])
    read = np.concatenate([grasp.position_m for grasp in grasps])
    rounding = np.array([find_step(column) for column in read.T]) / np.sqrt(12)
    return np.maximum(white_noise(third, axis=0), rounding)


def start_position(grasp: MeasuredGrasp, stroke: float, noise: np.ndarray) -> np.ndarray:
    """Where the motors stood at the first sample, m or rad, ``(motors,)``.

    An encoder may be off and is noisy: near enough to the open end, or to the first command, motors stood at the nearer
    of the two; unless they are seen to go from where they were first read to another place while the first command is
    held.

    Args:
      grasp: whose log begins.
      stroke: of the motors, m or rad.
      noise: of their encoders, ``(motors,)``.
    """
    first, command = grasp.position_m[0], grasp.command_m[0]
    from_command, from_open = np.abs(first - command), np.abs(first - stroke)
    anchor = np.where(from_command < from_open, command, stroke)
    start = np.where(np.minimum(from_command, from_open) < _AT_REST * stroke, anchor, first)
    to_command = from_command < _AT_REST * stroke
    return np.where(to_command & _went(grasp, noise), first, np.clip(start, 0.0, stroke))


def _went(grasp: MeasuredGrasp, noise: np.ndarray) -> np.ndarray:
    """Which motors left their first reading, and for good, while the first command was held, ``(motors,)``."""
    other = np.any(grasp.command_m != grasp.command_m[0], axis=1)
    held = int(np.argmax(other)) if other.any() else len(other)
    if held < _HELD:
        return np.zeros(len(noise), bool)
    settled = np.median(grasp.position_m[held // 2 : held], axis=0)
    return np.abs(grasp.position_m[0] - settled) > _MOVED * noise
