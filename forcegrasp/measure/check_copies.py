"""Readings that are there twice: one sensor under two names, or one grasp under two."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from forcegrasp.errors import MeasurementError
from forcegrasp.measure.folder import show
from forcegrasp.measure.samples import place, samples_file
from forcegrasp.measure.schema import MeasuredGrasp, MeasurementSet

# The third difference of white noise turns its sign in 77 % of all steps, that of a smooth signal seldom.
_NOISY = 0.6
_ALWAYS = 0.8
# Smaller ones, as a share of all that the signal does, are a solver's.
_LEAST_BEND = 1e-6
# Fewer distinct readings than this may agree by chance.
_LEAST_VALUES = 20


def check_copies(measured: MeasurementSet) -> list[str]:
    """Returns a warning for each grasp, and each sensor, whose readings are another's to the last bit.

    A symmetric grasp in a noiseless simulation may give that.

    Raises:
      MeasurementError: if two sensors have the same noise, which no measurement gives.
    """
    where, warnings = samples_file(measured.path), []
    names = (*measured.columns.position, *measured.columns.force)
    readings = {name: [grasp.signals()[name] for grasp in measured.grasps] for name in names}
    for (one, values), (other, others) in combinations(readings.items(), 2):
        if not all(np.array_equal(a, b) for a, b in zip(values, others, strict=True)):
            continue
        distinct = len(np.unique(np.concatenate(values)))
        if distinct >= _LEAST_VALUES and is_noisy(values):
            raise MeasurementError(
                f"{where}: columns {one} and {other}: the same readings in every row, noise included; no two sensors"
                " give that: was one column written twice?"
            )
        if distinct > 1:
            warnings.append(f"{where}: columns {one} and {other}: the same readings in every row; is one a copy?")
    return warnings + _same_grasps(measured)


def is_noisy(signals: Sequence[np.ndarray]) -> bool:
    """Whether one sensor's signals ``(T,)`` jitter all the time; without noise they rest or bend for a while."""
    reach = max(float(np.ptp(signal)) for signal in signals)
    turns = pairs = steps = 0
    for signal in signals:
        bend = np.diff(signal, 3)
        bend[np.abs(bend) < _LEAST_BEND * reach] = 0
        follow = bend[:-1] * bend[1:]
        turns, pairs = turns + np.count_nonzero(follow < 0), pairs + np.count_nonzero(follow)
        steps += len(follow)
    return bool(pairs > _ALWAYS * steps and turns > _NOISY * pairs)


def _same_grasps(measured: MeasurementSet) -> list[str]:
    """Grasps that agree to the last bit: right for a noiseless simulation, a slip anywhere else."""
    seen: dict[bytes, MeasuredGrasp] = {}
    warnings = []
    for grasp in measured.grasps:
        first = seen.setdefault(np.hstack([grasp.position_m, grasp.force_n]).tobytes(), grasp)
        if first is not grasp:
            warnings.append(f"{place(measured.path, grasp)}: the same readings as grasp {show(first.name)}; copied?")
    return warnings
