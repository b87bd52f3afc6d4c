"""At which physics steps samples are taken, and how long these steps are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from forcegrasp.measure.schema import MeasuredGrasp

# A physics step that is off by less than this share is what it should be; by more than the other, it is no longer that
# of the gripper. Samples that scatter by this share of it have no period.
_SAME_STEP, _OTHER_STEP, _JITTER = 1e-5, 0.1, 0.25
# Samples that are this share of a step beside one are on it.
_ON_A_STEP = 0.01
# Steps are made so many times as long as they were, at least and at most: what is less even has no period.
_SHORTEST, _LONGEST = 0.7, 1.4


@dataclass(frozen=True)
class SampleSteps:
    """Physics steps of the samples of grasps. Where time stamps scatter, those between two samples share their time."""

    starts: list[np.ndarray]  #: at which step each sample is taken, per grasp ``(samples,)``
    at_once: int = 1  #: number of steps that are equally long
    stretch: np.ndarray | None = None  #: how many times as long as usual they are, ``(steps ÷ at_once, grasps)``

    def lengths(self, steps: int) -> np.ndarray | None:
        """The same for so many steps: after the last sample they are as long as usual."""
        if self.stretch is None:
            return None
        more = max(0, -(-steps // self.at_once) - len(self.stretch))
        return np.pad(self.stretch, ((0, more), (0, 0)), constant_values=1.0)


def steps_passed(grasps: Sequence[MeasuredGrasp], dt: float) -> list[np.ndarray]:
    """Steps of ``dt`` seconds, and parts of one, that have passed at each sample, per grasp ``(samples,)``."""
    return [(g.time_s - g.time_s[0]) / dt for g in grasps]


def at_nearest_steps(grasps: Sequence[MeasuredGrasp], dt: float) -> SampleSteps:
    """The steps that are nearest to the samples, all of the usual length."""
    return SampleSteps([np.rint(one).astype(int) for one in steps_passed(grasps, dt)])


def place_samples(grasps: Sequence[MeasuredGrasp], dt: float) -> SampleSteps:
    """The steps at which samples are taken: whole ones between two of them, which share the time that passes.

    Samples of which no number of steps is a period, but for a few that are missing, are taken at the nearest ones.

    Args:
      grasps: with time stamps.
      dt: physics step, seconds.
    """
    real, nearest = steps_passed(grasps, dt), at_nearest_steps(grasps, dt)
    if all(np.abs(one - start).max() < _ON_A_STEP for one, start in zip(real, nearest.starts, strict=True)):
        return nearest
    apart = [np.diff(one) for one in real]
    period = float(np.median(np.concatenate(apart)))
    at_once = max(1, round(period))
    periods = [np.maximum(1, np.rint(one / period)).astype(int) for one in apart]
    lengths = [one / (n * at_once) for one, n in zip(apart, periods, strict=True)]
    every = np.concatenate(lengths)
    if abs(period / at_once - 1) > _OTHER_STEP or every.min() < _SHORTEST or every.max() > _LONGEST:
        return nearest
    starts = [np.r_[0, n.cumsum()] * at_once for n in periods]
    stretch = np.ones((max(n.sum() for n in periods), len(grasps)))
    for index, (length, n) in enumerate(zip(lengths, periods, strict=True)):
        stretch[: n.sum(), index] = np.repeat(length, n)
    return SampleSteps(starts, at_once, stretch)


def fitting_factor(grasps: Sequence[MeasuredGrasp], timestep: float) -> float:
    """What a physics step is multiplied with for samples to be whole steps apart; 1 if they are, or never will be."""
    apart = np.concatenate([np.diff(g.time_s) for g in grasps])
    period = float(np.median(apart))
    factor = period / (timestep * max(1.0, np.rint(period / timestep)))
    regular = np.median(np.abs(apart - period)) < _JITTER * timestep
    return factor if regular and _SAME_STEP < abs(factor - 1) < _OTHER_STEP else 1.0
