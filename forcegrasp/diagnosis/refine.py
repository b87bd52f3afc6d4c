"""Fits everything again with one more effect, from where its signature puts it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from forcegrasp.diagnosis.signatures import Background, Score, best_sizes
from forcegrasp.diagnosis.study import Study
from forcegrasp.effects.setting import EffectSetting
from forcegrasp.identify.fit import Fit, fit_once
from forcegrasp.identify.problem import Problem
from forcegrasp.short_repr import ShortRepr

# At its best size an effect promises nearly what a fit will gain: one that promises less than this share of the best
# gain has lost.
_LOST = 0.4


@dataclass(frozen=True, eq=False, repr=False)
class Refined(ShortRepr):
    """A rough fit with one more effect."""

    score: Score  #: the signature that it started from
    fit: Fit


def refine(scores: Sequence[Score], study: Study, fit: Fit, background: Background) -> list[Refined]:
    """Fits with each effect that may still be the best one; those that promise most come first.

    Args:
      scores: the best signature of each effect or variant.
      study: the measurements.
      fit: of the model without these effects.
      background: what gets no credit.
    """
    pairs = list(zip(best_sizes(scores, study, fit, background), scores, strict=True))
    pairs.sort(key=lambda pair: -pair[0].gain)
    best = pairs[0][0].gain if pairs else 0.0
    pairs = [(sized, score) for sized, score in pairs if sized.gain >= min(best, _LOST * best)]
    refined = []
    for number, (sized, score) in enumerate(pairs, 1):
        setting = sized.setting
        study.progress(f"refitting with {setting.effect.name} {setting.variant} ({number} of {len(pairs)})")
        refined.append(Refined(score, _fit_with(setting, study, fit)))
    return refined


def _fit_with(setting: EffectSetting, study: Study, fit: Fit) -> Fit:
    """Few grasps lead most of the way."""
    some, part = study.on_few(fit)
    start = fit.vector
    if some is not study:
        few = _fit_from(part.vector, setting, some, part)
        before, setting = few.vector[: len(part.problem)], few.problem.case(few.vector).effects[-1]
        start = fit.moved(part.problem, before)
    return _fit_from(start, setting, study, fit)


def _fit_from(start: np.ndarray, setting: EffectSetting, study: Study, fit: Fit) -> Fit:
    old = fit.problem
    problem = Problem(old.gripper, old.grasps, [*old.effects, setting])
    start = np.r_[start, problem.start()[len(old) :]]
    return fit_once(study.target, problem, study.simulators, start, fit.correction, rounds=0, known_slopes=fit.jacobian)
