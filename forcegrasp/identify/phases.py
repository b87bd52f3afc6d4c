"""Phases of a grasp, from the measured data alone: when fingers touch, and when commands rest."""

from __future__ import annotations

import numpy as np

from forcegrasp.measure.schema import MeasuredGrasp
from forcegrasp.physics.gripper import Gripper

PHASES = ("free", "first_contact", "both", "hold", "release")
#: The same of a servo that grasps nothing.
SERVO_PHASES = ("moving", "reversing", "holding", "released")
#: A command that has not changed for this long is held, seconds.
HELD_S = 0.3

# Contact is young, or just lost, for this long, seconds.
_TRANSITION_S = 0.2
# Without a force sensor: a motor that moves by less than this share of its largest command step hardly moves.
_STALL = 0.1


def phases_of(gripper: Gripper) -> tuple[str, ...]:
    """Names of the phases of what a gripper, or a servo, does."""
    return SERVO_PHASES if gripper.is_servo else PHASES


def find_phases(grasp: MeasuredGrasp, sigma: np.ndarray, gripper: Gripper) -> np.ndarray:
    """Phase of each sample, as an index into :func:`phases_of`, ``(T,)``, from the measured data alone.

    Args:
      grasp: the grasp.
      sigma: noise of its signals, as for :func:`contacts`.
      gripper: that recorded it.
    """
    if gripper.is_servo:
        return _servo_phases(grasp)
    touching = contacts(grasp, sigma, gripper)
    time, any_touch, both = grasp.time_s, np.any(touching, axis=1), np.all(touching, axis=1)
    held = held_for(grasp) >= HELD_S
    opening = np.zeros(len(time), bool)
    change = np.diff(grasp.command_m.mean(axis=1), prepend=grasp.command_m[0].mean())
    last = 0.0
    for index, step in enumerate(change):  # the direction of the last change of the command
        last = step if step != 0 else last
        opening[index] = last > 0
    phase = np.where(both & held, PHASES.index("hold"), PHASES.index("both"))
    since_both = _time_since_start(time, both)
    phase[any_touch & (~both | (since_both < _TRANSITION_S))] = PHASES.index("first_contact")
    phase[~any_touch] = PHASES.index("free")
    recently = _time_since_end(time, any_touch) < _TRANSITION_S
    leaving = opening & ((any_touch & ~(both & held)) | (~any_touch & recently))
    phase[leaving] = PHASES.index("release")
    return phase


def _servo_phases(grasp: MeasuredGrasp) -> np.ndarray:
    """Phases of a servo: its command rests, moves, or that of a joint has just turned round; or it is switched off."""
    time, turns = grasp.time_s, []
    for command in grasp.command_m.T:
        direction = np.sign(np.diff(command, prepend=command[0]))
        moving = np.flatnonzero(direction)
        turns.append(moving[1:][direction[moving[1:]] != direction[moving[:-1]]])
    turned = np.unique(np.concatenate(turns))
    phase = np.full(len(time), SERVO_PHASES.index("moving"))
    if len(turned):
        since = time - time[turned][np.searchsorted(turned, np.arange(len(time)), side="right") - 1]
        phase[(since >= 0) & (since < _TRANSITION_S)] = SERVO_PHASES.index("reversing")
    phase[held_for(grasp) >= HELD_S] = SERVO_PHASES.index("holding")
    if grasp.enabled is not None:
        phase[~np.asarray(grasp.enabled, bool)] = SERVO_PHASES.index("released")
    return phase


def contacts(grasp: MeasuredGrasp, sigma: np.ndarray, gripper: Gripper) -> np.ndarray:
    """Which finger touches, by its force beyond what it reads in free air, ``(T, channels)``.

    Without force readings the way that a motor is behind its command takes their place, ``(T, motors)``.

    Args:
      grasp: the grasp.
      sigma: noise of its signals, ``(C,)``; the forces' is enough where there are any.
      gripper: that recorded it.
    """
    if gripper.is_servo:
        return np.zeros(grasp.position_m.shape, bool)
    push = grasp.force_n if grasp.force_n.shape[1] else grasp.position_m - grasp.command_m
    start = push[: max(3, min(8, len(push) // 10))]
    beyond, least = push - np.median(start, axis=0), 5 * sigma[-push.shape[1] :]
    if gripper.force == "sensors":
        return beyond > least
    moved = _moved(grasp, gripper.period_s)
    least, still = _effort_of_closing(beyond, moved, gripper, least), np.abs(moved) < _STALL * gripper.max_step
    for index in range(1, len(still)):  # a contact lasts until the push ends
        still[index] |= still[index - 1] & (beyond[index - 1] > least)
    return still & (beyond > least)


def _moved(grasp: MeasuredGrasp, period_s: float) -> np.ndarray:
    """How far each motor moved in the control period before each sample, ``(T, motors)``; opening is positive."""
    before = np.searchsorted(grasp.time_s, grasp.time_s - 1.01 * period_s)
    return grasp.position_m - grasp.position_m[before]


def _effort_of_closing(beyond: np.ndarray, moved: np.ndarray, gripper: Gripper, least: np.ndarray) -> np.ndarray:
    """What of a push friction alone may hold, ``(channels,)``: little of what it takes to close; ``least`` at least."""
    closing = np.where(moved < -_STALL * gripper.max_step, beyond, np.nan)
    columns = [column[np.isfinite(column)] for column in closing.T]
    return np.maximum(least, [np.quantile(column, 0.25) if len(column) else 0.0 for column in columns])


def _time_since_start(time: np.ndarray, on: np.ndarray) -> np.ndarray:
    """Seconds since ``on`` last became true; infinite where it is not."""
    starts = on & ~np.r_[False, on[:-1]]
    index = np.maximum.accumulate(np.where(starts, np.arange(len(on)), -1))
    return np.where(on, time - time[np.maximum(index, 0)], np.inf)


def _time_since_end(time: np.ndarray, on: np.ndarray) -> np.ndarray:
    """Seconds since ``on`` was last true; infinite before."""
    index = np.maximum.accumulate(np.where(on, np.arange(len(on)), -1))
    return np.where(index >= 0, time - time[np.maximum(index, 0)], np.inf)


def held_for(grasp: MeasuredGrasp) -> np.ndarray:
    """Seconds since the command last changed, ``(T,)``."""
    changed = np.r_[True, np.any(np.diff(grasp.command_m, axis=0) != 0, axis=1)]
    return grasp.time_s - grasp.time_s[np.maximum.accumulate(np.where(changed, np.arange(len(changed)), 0))]
