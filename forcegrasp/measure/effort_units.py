"""Are efforts of motors in one unit, and of one sign, in all grasps? How far motors stand from their commands tells."""

from __future__ import annotations

import numpy as np

from forcegrasp.measure.schema import MeasuredGrasp, MeasurementSet

# A motor presses where it is kept from its command by this share of the most that it is in any grasp, and rests where
# it moves by less than the second share of that between two rows. So many rows tell.
_PRESSES, _RESTS, _ROWS = 0.2, 0.01, 5
# Efforts of most grasps go with that, to a factor; those that are off by more than the second, or turned round, are
# of another unit or sign; all that are alike to the third are of one.
_USUAL, _OFF, _ALIKE = 2.0, 3.0, 1.35
# A factor that is off by less is a sign alone.
_TURNED_ROUND = 0.1


def find_odd_effort(measured: MeasurementSet) -> tuple[float, tuple[int, ...]] | None:
    """The grasps in which a motor's effort reads so many times what the others make of it; None if there are none.

    A servo's effort goes with how far it is kept from its command, whatever it presses.

    Returns:
      The factor, negative where the sign is another, and indices of the grasps.
    """
    most = max((float(np.abs(_short(grasp)).max(initial=0.0)) for grasp in measured.grasps), default=0.0)
    found = {index: ratio for index, g in enumerate(measured.grasps) if (ratio := _gain(g, most)) is not None}
    if not found:
        return None
    usual = float(np.median(list(found.values())))
    if usual == 0:
        return None
    times = {index: ratio / usual for index, ratio in found.items()}
    if sum(1 / _USUAL < factor < _USUAL for factor in times.values()) <= len(times) / 2:
        return None  # the effort is not that of a servo without memory
    odd = {index: factor for index, factor in times.items() if not 1 / _OFF < factor < _OFF}
    groups = [tuple(i for i, other in odd.items() if 1 / _ALIKE < other / factor < _ALIKE) for factor in odd.values()]
    if not groups:
        return None
    alike = max(groups, key=len)
    factor = float(np.median([odd[index] for index in alike]))
    return (-1.0 if abs(factor + 1) < _TURNED_ROUND else factor), alike


def _short(grasp: MeasuredGrasp) -> np.ndarray:
    """How far the motor is open of its command, m or rad, ``(T,)``: until a row is read the command before acts."""
    return grasp.position_m[1:, 0] - grasp.command_m[:-1, 0]


def _gain(grasp: MeasuredGrasp, most: float) -> float | None:
    """Effort ÷ how far the motor is kept from its command, where it presses at rest; None if it hardly does."""
    short = _short(grasp)
    rests = np.abs(np.diff(grasp.position_m[:, 0])) < _RESTS * most
    held = grasp.command_m[1:, 0] == grasp.command_m[:-1, 0]
    there = (short > _PRESSES * most) & rests & held
    return float(np.median(grasp.force_n[1:, 0][there] / short[there])) if there.sum() >= _ROWS else None
