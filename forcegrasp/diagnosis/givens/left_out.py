"""Leaves out the few grasps that a model misses by far the most, where no effect explains all of them.

Behind lost motion a stiff servo may shake an object, and by a hair's breadth in any parameter it shakes otherwise: no
fit foretells that, and one such grasp hides what all others show. So does one that went wrong.
"""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from forcegrasp.diagnosis.faults.odd_grasps import OddGrasp, errors_as
from forcegrasp.diagnosis.result import Diagnosis
from forcegrasp.diagnosis.verdict import EXPLAINED_FAR, MUCH
from forcegrasp.identify.cross_validation import rms_of_grasps
from forcegrasp.identify.fit import Fit
from forcegrasp.identify.loading import Loaded
from forcegrasp.identify.target import Target
from forcegrasp.identify.verdict import Verdict
from forcegrasp.measure import MeasurementSet

# A grasp is missed by far if its error is so many times the median of all.
_FAR = 2.5
# So many of a set are left out at most, as a share; where more are missed, it is the model. Objects keep two grasps.
_SHARE, _KEPT = 1 / 6, 2


@dataclass(eq=False)
class LeaveOutFirst:
    """Whether grasps are to be left out before effects that promise little are fitted."""

    names: tuple[str, ...] = ()  #: which, of the last fit that was asked for

    def __call__(self, target: Target, fit: Fit) -> bool:
        self.names = most_missed(target, fit)
        return bool(self.names)


def most_missed(target: Target, fit: Fit) -> tuple[str, ...]:
    """Names of the few grasps that a fit of all misses by far the most, the worst first; none if there are many."""
    if target.gripper.is_servo:
        return ()
    errors, left = rms_of_grasps(fit.residual, target), Counter(grasp.object for grasp in target.grasps)
    missed = [index for index in np.argsort(-errors) if errors[index] > _FAR * max(1.0, float(np.median(errors)))]
    if len(missed) > _SHARE * len(errors):
        return ()
    names = list[str]()
    for grasp in (target.grasps[index] for index in missed):
        if left[grasp.object] > _KEPT:
            left[grasp.object] -= 1
            names.append(grasp.name)
    return tuple(names)


def without(loaded: Loaded[MeasurementSet], names: Sequence[str]) -> Loaded[MeasurementSet]:
    """A set without the grasps of these names."""
    rest = tuple(grasp for grasp in loaded.measured.grasps if grasp.name not in names)
    return dataclasses.replace(loaded, measured=dataclasses.replace(loaded.measured, grasps=rest))


def is_answer(found: Diagnosis) -> bool:
    """Whether effects explain as good as all that the other grasps show: else nothing was gained by leaving out any.

    Or all that the model with them can foretell: others may shake as well, a little. Where the model needs no effect
    for the others, a single grasp went wrong; several may show together what it lacks.
    """
    if found.verdict is Verdict.EXPLAINED:
        return len(found.left_out) == 1
    little = not found.left or (found.explained >= EXPLAINED_FAR and found.error_after <= MUCH * found.floor)
    return found.verdict.lacks_effects and (little or found.error_after <= found.floor_of_model)


def told_of(found: Diagnosis, names: Sequence[str], target: Target) -> Diagnosis:
    """The diagnosis of the other grasps, with those that were left out.

    Args:
      found: of the others.
      names: of those left out.
      target: all of them.
    """
    which = np.array([i for i, grasp in enumerate(target.grasps) if grasp.name in names])
    grasps = [target.grasps[i] for i in which]
    errors = errors_as(target, which, grasps, found.fit.problem, found.fit.vector)
    odd = tuple(OddGrasp(g.name, g.object, error) for g, error in zip(grasps, errors.tolist(), strict=True))
    return dataclasses.replace(found, left_out=odd)
