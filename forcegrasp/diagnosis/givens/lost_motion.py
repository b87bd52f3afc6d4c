"""Lost motion beside a set whose radii were moved: objects that are all smaller look like it, and hide it."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np

from forcegrasp.diagnosis.families import look_alike, may_join
from forcegrasp.diagnosis.faults.tolerance import Moved
from forcegrasp.effects import Effect
from forcegrasp.effects.object_size import ObjectSize
from forcegrasp.effects.setting import EffectSetting
from forcegrasp.identify.fit import Fit, fit_once
from forcegrasp.identify.problem import Problem
from forcegrasp.identify.progress import Progress
from forcegrasp.identify.side_by_side import side_by_side
from forcegrasp.identify.simulators import Simulators
from forcegrasp.identify.target import Target
from forcegrasp.measure import MeasurementSet


def with_lost_motion(
    fit: Fit,
    target: Target,
    moved: Moved,
    measured: MeasurementSet,
    effects: Sequence[type[Effect]],
    progress: Progress,
) -> Iterator[tuple[Fit, Moved]]:
    """Rough fits with an effect that makes up for radii which were moved down on average; nothing if they were not.

    Args:
      fit: of the set as moved.
      target: the measurements as moved.
      moved: by how much what is given was moved.
      measured: the set as it is.
      effects: the catalogue.
      progress: told what is going on.

    Yields:
      The fit with the best variant of each effect, its last one, and the moves of what it was fitted to: radii as
      before, without what they have in common.
    """
    smaller_m, known = moved.smaller_m, [one.effect for one in fit.problem.effects]
    alike = [e for e in effects if e.family == "lost motion" and look_alike(e, ObjectSize) and may_join(e, known)]
    if not smaller_m or not alike:
        return
    raised, gripper = moved.with_radii_raised(smaller_m), fit.problem.gripper
    grasps = tuple(raised.put(grasp) for grasp in measured.grasps)
    of_raised = dataclasses.replace(target, grasps=grasps)
    # in the middle of its gap a finger touches late by half of it
    gap = 2 * smaller_m / abs(gripper.opening.travel[0])
    for effect in alike:
        progress(f"trying {effect.name} of {gap:.2g} {gripper.unit} in place of smaller radii")
        sizes = np.r_[gap, effect.typical_values()[1:]]
        settings = [EffectSetting(effect, variant, sizes) for variant in effect.variants]
        fits = side_by_side([partial(_roughly_with, one, fit, of_raised) for one in settings])
        yield min(fits, key=lambda one: one.cost), raised


def _roughly_with(setting: EffectSetting, fit: Fit, target: Target) -> Fit:
    """A rough fit with one more effect of so much, to grasps that are a little different."""
    problem = Problem(fit.problem.gripper, target.grasps, [*fit.effects, setting])
    start = np.r_[fit.vector, problem.start()[len(fit.vector) :]]
    return fit_once(target, problem, Simulators(problem), start, fit.correction, rounds=0)
