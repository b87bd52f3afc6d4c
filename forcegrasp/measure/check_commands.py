"""Do commands, positions and efforts of a servo belong together, and has each its own column, unit and sign?"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from forcegrasp.errors import MeasurementError
from forcegrasp.measure.folder import show
from forcegrasp.measure.samples import place
from forcegrasp.measure.schema import MeasuredGrasp, MeasurementSet

# A column is a copy of another one, some rows apart, if so many of the samples at which it changes are the very same.
_SHIFTS, _SAME, _LEAST_CHANGES, _LEAST_VALUES = (0, 1, -1, 2, -2, 3, -3), 0.98, 20, 10
# What a position that follows its command in another unit, or turned round, is in multiples of it.
_FACTORS = (
    (180 / np.pi, "the command is in degrees and the position in radians"),
    (np.pi / 180, "the command is in radians and the position in degrees"),
    (1000.0, "the command is in millimetres and the position in metres"),
    (0.001, "the command is in metres and the position in millimetres"),
    (-1.0, "one of them is turned round"),
)
_NEAR, _FOLLOWS = 0.15, 0.9
# A servo that is weak for its load goes less far than it is told to, but not by so much; further it hardly goes.
_LEAST, _MOST = 0.05, 3.0
# Joints are swapped if a position follows another joint's command like this, and its own no better than that.
_OTHERS, _OWN = 0.95, 0.6
# Efforts that are never negative, and come down to this share of their size, though the joint goes both ways.
_NEAR_ZERO, _BOTH_WAYS = 0.05, 0.2
# What a servo has yet to go and its speed give so much of its effort's variance, if they are what drives it.
_DRIVEN = 0.6


def check_relation(measured: MeasurementSet, joint: int, span: float) -> list[str]:
    """Refuses commands that are positions, as they are or some rows apart, or are in another unit, or turned round.

    Args:
      measured: the set.
      joint: which of its joints.
      span: how far the joint usually moves, m or rad.
    """
    name = measured.columns.command[joint]
    if not name.startswith("qdes"):
        return []
    refuse_copied_command(measured, joint)
    slopes = [slope for one in measured.grasps if (slope := _slope(one, joint)) is not None]
    middle = float(np.median(slopes)) if slopes else 1.0
    for factor, what in _FACTORS:
        if abs(middle * factor - 1) < _NEAR:
            raise MeasurementError(
                f"{show(measured.path)}: column {name}: goes {1 / middle:.3g} times as far as the position: {what};"
                " say its unit or sign"
            )
    if not _LEAST < middle < _MOST:
        return [
            f"{show(measured.path)}: column {name}: the position goes {middle:.3g} times as far; are both in"
            f" {measured.columns.unit}?"
        ]
    return _far_apart(measured, joint, span) if slopes and abs(middle - 1) < _NEAR else []


def refuse_copied_command(measured: MeasurementSet, motor: int) -> None:
    """Raises MeasurementError if commands of a motor are its position, as it is or some rows apart."""
    for one in measured.grasps:
        shift = _copied(one.command_m[:, motor], one.position_m[:, motor])
        if shift is not None:
            apart = f"{abs(shift)} rows {'earlier' if shift > 0 else 'later'}" if shift else "as it is"
            raise MeasurementError(
                f"{place(measured.path, one, None, measured.columns.command[motor])}: is the position itself, {apart}:"
                " nothing that was commanded; name the command's own column"
            )


def _copied(command: np.ndarray, position: np.ndarray) -> int | None:
    """By how many rows one is a copy of the other; None if it is none."""
    for shift in _SHIFTS:
        kept = slice(4, -4)
        moved = np.roll(position, shift)[kept]
        changes = np.diff(moved, prepend=moved[:1]) != 0
        many = changes.sum() >= _LEAST_CHANGES and len(np.unique(moved)) >= _LEAST_VALUES
        if many and np.mean(command[kept][changes] == moved[changes]) >= _SAME:
            return shift
    return None


def _slope(one: MeasuredGrasp, joint: int) -> float | None:
    """How far the position goes for one unit of its command; None where it does not follow."""
    on = _switched_on(one)
    command, position = one.command_m[on, joint], one.position_m[on, joint]
    if len(command) < 10 or abs(correlation(command, position)) < _FOLLOWS:
        return None
    return float(np.polyfit(command, position, 1)[0])


def _switched_on(one: MeasuredGrasp) -> np.ndarray:
    """At which samples the servo is switched on, ``(T,)``."""
    return np.ones(len(one.time_s), bool) if one.enabled is None else np.asarray(one.enabled, float) > 0


def _far_apart(measured: MeasurementSet, joint: int, span: float) -> list[str]:
    """Warns where position and command move alike and stand apart: they may count from different places."""
    apart = [float(np.median(g.position_m[:, joint] - g.command_m[:, joint])) for g in measured.grasps]
    offset, unit = float(np.median(apart)), measured.columns.unit
    if abs(offset) < 0.5 * span:
        return []
    return [
        f"{show(measured.path)}: column {measured.columns.position[joint]}: stands {offset:+.3g} {unit} from its"
        " command while both move alike; do they count from the same place? An offset says so"
    ]


def correlation(one: np.ndarray, other: np.ndarray) -> float:
    """Of two signals ``(T,)``; 0 where one does not change."""
    return float(np.corrcoef(one, other)[0, 1]) if np.ptp(one) > 0 and np.ptp(other) > 0 else 0.0


def check_order(measured: MeasurementSet) -> None:
    """Raises MeasurementError if positions follow the commands of other joints."""
    if all(name.startswith("qdes") for name in measured.columns.command):
        for one in measured.grasps:
            refuse_swapped(place(measured.path, one), measured.columns.position, one.command_m, one.position_m)


def refuse_swapped(where: str, joints: Sequence[str], command: np.ndarray, position: np.ndarray) -> None:
    """Raises MeasurementError if positions follow the commands of other joints.

    Args:
      where: the recording, for the message.
      joints: names of the joints.
      command: ``(T, J)``.
      position: ``(T, J)``.
    """
    for index, joint in enumerate(joints):
        follows = [correlation(command[:, other], position[:, index]) for other in range(len(joints))]
        best = int(np.argmax(follows))
        its_own = correlation(command[:, best], position[:, best])
        if follows[best] > _OTHERS and follows[index] < _OWN and its_own < _OWN:
            raise MeasurementError(
                f"{where}: the position of {joint} follows the command of {joints[best]}, whose own does not: commands"
                " and positions have their joints in another order; put them in the same one"
            )


def check_efforts(measured: MeasurementSet, unsigned: bool) -> list[str]:
    """Refuses efforts without their sign and such that never change; warns of such that look turned round."""
    warnings = []
    for channel, name in enumerate(measured.columns.force):
        where = f"{show(measured.path)}: column {name}"
        efforts = np.concatenate([one.force_n[:, channel] for one in measured.grasps])
        if np.ptp(efforts) == 0:
            raise MeasurementError(f"{where}: never changes; is it the right column? Or say `effort: none`")
        if unsigned:
            continue
        if efforts.min() >= 0 and _size_alone(measured, efforts, channel):
            raise MeasurementError(
                f"{where}: never negative, and down to 0 while the joint goes both ways: looks like a size without its"
                " sign; say `signed: false` in its map, and `effort: unsigned` or `none` in the mechanism"
            )
        if not measured.columns.command[channel].startswith("qdes"):
            continue
        if against := [one.name for one in measured.grasps if _falls_with_what_is_to_go(one, channel)]:
            those = "" if len(against) == len(measured.grasps) else f" in {', '.join(against)}"
            warnings.append(f"{where}: falls where the servo has further to go{those}; is its sign turned round?")
    return warnings


def _falls_with_what_is_to_go(one: MeasuredGrasp, joint: int) -> bool:
    """Whether an effort is that of a servo which drives away from its command, as far as it is switched on."""
    on = _switched_on(one)
    position, effort = one.position_m[:, joint], one.force_n[on, joint]
    speed = np.gradient(position, one.time_s)
    causes = np.column_stack([one.command_m[:, joint] - position, speed, np.ones(len(position))])[on]
    if len(effort) < _LEAST_CHANGES or np.ptp(effort) == 0 or np.ptp(causes[:, 0]) == 0:
        return False
    weights = np.linalg.lstsq(causes, effort, rcond=None)[0]
    explained = 1 - np.var(effort - causes @ weights) / np.var(effort)
    return bool(weights[0] < 0 and explained > _DRIVEN)


def _size_alone(measured: MeasurementSet, efforts: np.ndarray, joint: int) -> bool:
    """Whether efforts that are never negative can't be those of a joint that goes both ways."""
    moves = np.concatenate([np.diff(one.position_m[:, joint]) for one in measured.grasps])
    moves = moves[moves != 0]
    both = len(moves) > 0 and _BOTH_WAYS < np.mean(moves > 0) < 1 - _BOTH_WAYS
    low, high = np.quantile(efforts, [0.02, 0.95])
    return bool(both and low <= _NEAR_ZERO * high)
