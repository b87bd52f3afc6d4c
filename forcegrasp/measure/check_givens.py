"""Is a set's clock that of the gripper, and is a force's zero the same in all its grasps?"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from forcegrasp.measure.check_liveness import LEAST_ROWS, force_noise, zero_force
from forcegrasp.measure.folder import show
from forcegrasp.measure.force_units import check_force_units
from forcegrasp.measure.samples import place, samples_file
from forcegrasp.measure.schema import MeasurementSet

# Commands that are further apart than this many times what a gripper takes, or closer, are no jitter.
_OTHER_CLOCK = 1.2
# Commands come at most that often if this share of them does, for steps are further apart. Fewer tell nothing.
_OFTEN, _LEAST_COMMANDS = 0.05, 40
# A zero has changed if it differs by so many standard deviations of a grasp's own, with two grasps at least on either
# side, of which this share lies nearer to its own side's median: a drift from grasp to grasp has neither.
_CHANGED, _EITHER_SIDE, _STAYS = 5.0, 2, 0.8
# One grasp's zero is another if it differs from the usual one by so many of its standard deviations; so many are at
# most, as a share, and where more are, zeros wander.
_ODD_ZERO, _FEW = 10.0, 1 / 6
# The standard deviation over the median absolute deviation, of a normal distribution.
_MAD = 1.4826


@dataclass(frozen=True)
class Tare:
    """The zeros of forces change from one grasp to the next, and stay so: for good, or for one grasp."""

    first: int  #: index of the first grasp that has the new ones
    end: int  #: index after the last one
    change_n: np.ndarray  #: by how much they are larger there, ``(channels,)``; 0 where they are the same

    def words(self, measured: MeasurementSet) -> str:
        """What changes where, such as "f_l_n by -0.9 N"."""
        named = zip(measured.columns.force, self.change_n, strict=True)
        return ", ".join(f"{name} by {change:+.3g} N" for name, change in named if change)


def check_givens(measured: MeasurementSet, period_s: float) -> list[str]:
    """Returns a warning for a clock, a zero or a unit that does not look right; a diagnosis tries to put them right.

    Args:
      measured: grasps of a gripper.
      period_s: how often the gripper is commanded, by its description.
    """
    warnings = []
    if (factor := clock_factor(measured, period_s)) is not None:
        warnings.append(
            f"{samples_file(measured.path)}: column t_s: commands are {factor * period_s:.3g} s apart where"
            f" {show(measured.gripper)} takes one every {period_s:g} s: are time stamps {times(factor)}? else name"
            f" a description of your gripper whose period_s is {factor * period_s:.3g}"
        )
    if (tare := find_tare(measured)) is not None:
        where = place(measured.path, measured.grasps[tare.first])
        told = tare.words(measured)
        warnings.append(f"{where}: from here on forces are shifted ({told}); was the zero set anew between two grasps?")
    else:
        warnings += [
            f"{place(measured.path, measured.grasps[odd.first])}: forces are shifted in this grasp alone"
            f" ({odd.words(measured)}); was their zero set while something was held?"
            for odd in find_odd_zeros(measured)
            if (odd.change_n <= 0).all()  # fingers that press from the start on read more
        ]
    return warnings + check_force_units(measured)


def times(factor: float) -> str:
    """How much too long or too short time stamps are, in words."""
    return f"{factor:.3g} times too long" if factor > 1 else f"{1 / factor:.3g} times too short"


def clock_factor(measured: MeasurementSet, period_s: float, most: float = _OTHER_CLOCK) -> float | None:
    """How many times a gripper's period its commands are apart; None if that may be right, or too few changed.

    Args:
      measured: the set.
      period_s: the gripper's.
      most: the largest factor, either way, that may be right.
    """
    apart = command_period_s(measured)
    return None if apart is None or same_clock(apart, period_s, most) else apart / period_s


def same_clock(one_s: float, other_s: float, most: float = _OTHER_CLOCK) -> bool:
    """Whether two control periods differ by no more than a factor; by default, by no more than jitter."""
    return 1 / most < one_s / other_s < most


def command_period_s(measured: MeasurementSet) -> float | None:
    """How often commands come at most; None if too few changed to tell."""
    apart, rows = [], []
    for grasp in measured.grasps:
        changed = np.flatnonzero(np.any(np.diff(grasp.command_m, axis=0) != 0, axis=1)) + 1
        rows.append(np.diff(changed))
        apart.append(float(np.median(np.diff(grasp.time_s))))
    gaps = np.concatenate(rows) if rows else np.array([])
    if len(gaps) < _LEAST_COMMANDS:
        return None
    return float(np.quantile(gaps, _OFTEN, method="lower") * np.median(apart))


def find_tare(measured: MeasurementSet) -> Tare | None:
    """Where the zeros of the forces change for good; None if they scatter as much, or there are too few grasps."""
    zeros, least = _zeros(measured)
    if not zeros.size or len(zeros) < 2 * _EITHER_SIDE:
        return None
    # the split about whose sides' medians readings lie closest: a grasp that starts in contact moves no median
    splits = range(_EITHER_SIDE, len(zeros) - _EITHER_SIDE + 1)
    first = min(splits, key=lambda first: float((np.abs(zeros - _sides(zeros, first)) / least).sum()))
    sides = _sides(zeros, first)
    apart, change = np.abs(zeros - sides), sides[-1] - sides[0]
    scatter = np.maximum(_MAD * np.median(apart, axis=0), least)
    near = apart < np.abs(zeros - (sides[0] + sides[-1] - sides))
    stays = np.minimum(near[:first].mean(axis=0), near[first:].mean(axis=0)) >= _STAYS
    changed = (np.abs(change) > _CHANGED * scatter) & stays
    return Tare(first, len(zeros), np.where(changed, change, 0.0)) if changed.any() else None


def find_odd_zeros(measured: MeasurementSet) -> list[Tare]:
    """The few grasps in which forces start from another zero than in all the others; none if zeros scatter."""
    zeros, least = _zeros(measured)
    if not zeros.size:
        return []
    change = zeros - np.median(zeros, axis=0)
    scatter = np.maximum(_MAD * np.median(np.abs(change), axis=0), least)
    odd = np.abs(change) > _ODD_ZERO * scatter
    where = np.flatnonzero(odd.any(axis=1))
    if len(where) > _FEW * len(zeros):
        return []
    return [Tare(int(k), int(k) + 1, np.where(odd[k], change[k], 0.0)) for k in where]


def _zeros(measured: MeasurementSet) -> tuple[np.ndarray, np.ndarray]:
    """What each grasp's forces read at its start, ``(grasps, channels)``, and how exactly, ``(channels,)``.

    Nothing where efforts are read, which are of the motion.
    """
    if measured.columns.read_effort:
        return np.zeros((0, 0)), np.zeros(0)
    zeros = np.array([zero_force(grasp.time_s, grasp.force_n) for grasp in measured.grasps])
    noise = np.median([[force_noise(f) for f in grasp.force_n.T] for grasp in measured.grasps], axis=0)
    return zeros, np.maximum(noise / np.sqrt(LEAST_ROWS), 1e-9)


def _sides(zeros: np.ndarray, first: int) -> np.ndarray:
    """Each grasp's median zero of its side of a split, ``(grasps, channels)``."""
    before, after = np.median(zeros[:first], axis=0), np.median(zeros[first:], axis=0)
    return np.where(np.arange(len(zeros))[:, None] < first, before, after)
