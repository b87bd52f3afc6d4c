"""Are forces in newtons, on either side and in all grasps? Two channels that press on one object tell, or commands."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from forcegrasp.measure.check_liveness import zero_force
from forcegrasp.measure.effort_units import find_odd_effort
from forcegrasp.measure.samples import samples_file
from forcegrasp.measure.schema import MeasuredGrasp, MeasurementSet
from forcegrasp.short_repr import some

# One that reads so many times the other in all grasps is in another unit; fewer samples tell nothing.
_OTHER_UNIT, _SAMPLES = 5.0, 20
# Both press where they read more than this share of the most that they do.
_PRESSES = 0.2
# Units and prefixes that logs are written in, newtons; kilograms of force are told as 10.
_UNITS = (4.44822, 10.0, 100.0, 1000.0)
# In a few grasps a channel is in another unit if it reads so many times what it does in others beside the other one,
# to within a factor, in so many of them at least, of so many samples. Most are those where it does not, to a factor.
_THERE, _FEWEST, _SAMPLES_OF_ONE, _USUAL = 1.35, 3, 5, 2.5
# So many grasps are named.
_TOLD = 8


@dataclass(frozen=True)
class OddUnit:
    """One force channel is in another unit in some of the grasps."""

    channel: int
    factor: float  #: it reads so many times what it does in the others
    grasps: tuple[int, ...]  #: indices of those where it does

    def words(self, grasps: Sequence[MeasuredGrasp]) -> str:
        """What it reads there, of these grasps."""
        names = [grasps[index].name for index in self.grasps]
        return f"reads about {self.factor:.3g} times in {some(names, _TOLD)} what it does in the others"

    def put_right(self, grasp: MeasuredGrasp) -> MeasuredGrasp:
        """One of these grasps as it would read in newtons."""
        units = np.where(np.arange(grasp.force_n.shape[1]) == self.channel, self.factor, 1.0)
        return dataclasses.replace(grasp, force_n=grasp.force_n / units)


def find_odd_unit(measured: MeasurementSet) -> OddUnit | None:
    """Grasps in which a force channel is in another unit than in the others, which are more; None if there are none.

    Of two channels it is one, of a motor's effort see :mod:`.effort_units`. Beside an object that stands off centre one
    finger may press much more than the other; but not ten times as much as it does in other grasps of that object.
    """
    if measured.columns.read_effort:
        odd = find_odd_effort(measured)
        return None if odd is None else OddUnit(0, *odd)
    if len(measured.columns.force) != 2:
        return None
    pressed = {i: _both(_loads(grasp)) for i, grasp in enumerate(measured.grasps)}
    pressed = {i: loads for i, loads in pressed.items() if len(loads) >= _SAMPLES_OF_ONE}
    if not pressed:
        return None
    level = {i: np.log(np.median(loads, axis=0)) for i, loads in pressed.items()}
    ratio = {i: float(np.median(np.log(loads[:, 1] / loads[:, 0]))) for i, loads in pressed.items()}
    usual = float(np.median(list(ratio.values())))
    even = [i for i in pressed if abs(ratio[i] - usual) < np.log(_USUAL)]
    if not even:
        return None

    def more(index: int, channel: int) -> float:
        """Logarithm of how much more a channel reads than in other grasps of the same object."""
        name = measured.grasps[index].object
        like = [i for i in even if measured.grasps[i].object == name and i != index] or even
        return float(level[index][channel] - np.median([level[i][channel] for i in like]))

    found = OddUnit(0, 1.0, ())
    for channel, factor in [(c, unit**way) for c in (0, 1) for unit in _UNITS for way in (1, -1)]:
        size, way = abs(np.log(factor)), np.sign(np.log(factor))
        off = {i: way * (1 if channel else -1) * (ratio[i] - usual) for i in pressed}
        there = [i for i in pressed if off[i] > size / 2 and way * more(i, channel) > size / 4]
        alike = [i for i in there if abs(off[i] - size) < np.log(_THERE)]
        if len(alike) >= max(_FEWEST, 1 + len(found.grasps)):
            found = OddUnit(channel, factor, tuple(there))
    return found if found.grasps else None


def check_force_units(measured: MeasurementSet) -> list[str]:
    """Warns where a force channel reads many times what the other does, or what it does in other grasps."""
    names = measured.columns.force
    if (odd := find_odd_unit(measured)) is not None:
        where = f"{samples_file(measured.path)}: column {names[odd.channel]}"
        return [f"{where}: {odd.words(measured.grasps)}; is it in newtons there, and f ≥ 0 where it presses?"]
    if len(names) != 2:
        return []
    both = _both(np.concatenate([_loads(grasp) for grasp in measured.grasps]))
    if len(both) < _SAMPLES:
        return []
    ratio = float(np.median(both[:, 1] / both[:, 0]))
    if 1 / _OTHER_UNIT < ratio < _OTHER_UNIT:
        return []
    large, small, by = (*names[::-1], ratio) if ratio > 1 else (*names, 1 / ratio)
    where = f"{samples_file(measured.path)}: column {large}"
    return [f"{where}: reads {by:.3g} times what {small} does; are both in newtons?"]


def _loads(grasp: MeasuredGrasp) -> np.ndarray:
    """Forces less their zeros, newtons, ``(T, channels)``."""
    return grasp.force_n - zero_force(grasp.time_s, grasp.force_n)


def _both(loads: np.ndarray) -> np.ndarray:
    """Those of the samples in which both channels press, ``(n, 2)``."""
    return loads[np.all((loads > _PRESSES * loads.max(axis=0)) & (loads > 0), axis=1)]
