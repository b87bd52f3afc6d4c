"""Fits everything again with one more effect, from where its signature puts it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from forcegrasp.diagnosis.signatures import Background, Score, best_sizes
from forcegrasp.identify.fit import Fit, Simulators, fit_once
from forcegrasp.identify.problem import Problem
from forcegrasp.identify.target import Target
from forcegrasp.short_repr import ShortRepr

# At its best size an effect promises nearly what a fit will gain: one that promises less than this share of the best
# gain has lost.
_LOST = 0.4


@dataclass(frozen=True, eq=False, repr=False)
class Refined(ShortRepr):
    """A rough fit with one more effect."""

    score: Score  #: the signature that it started from
    fit: Fit


def refine(
    scores: Sequence[Score],
    target: Target,
    fit: Fit,
    simulators: Simulators,
    background: Background,
    progress: Callable[[str], None] = lambda text: None,
) -> list[Refined]:
    """Fits with each effect that may still be the best one; those that promise most come first.

    Args:
      scores: the best signature of each effect or variant.
      target: the measurements.
      fit: of the model without these effects.
      simulators: of the same grasps.
      background: what gets no credit.
      progress: told what is going on.
    """
    pairs = list(zip(best_sizes(scores, fit, target, simulators, background), scores, strict=True))
    pairs.sort(key=lambda pair: -pair[0].gain)
    best = pairs[0][0].gain if pairs else 0.0
    pairs = [(sized, score) for sized, score in pairs if sized.gain >= min(best, _LOST * best)]
    refined = []
    for number, (sized, score) in enumerate(pairs, 1):
        progress(f"refitting with {score.effect.name} {score.variant} ({number} of {len(pairs)})")
        refined.append(Refined(score, _fit_with(sized, target, fit, simulators)))
    return refined


def _fit_with(score: Score, target: Target, fit: Fit, simulators: Simulators) -> Fit:
    old = fit.problem
    problem = Problem(old.gripper, old.grasps, [*old.effects, (score.effect, score.variant)])
    added = [e.coordinate(v) for e, v in zip(problem.entries[len(old) :], score.values, strict=True)]
    start = np.r_[fit.vector, added]
    return fit_once(target, problem, simulators, start, fit.correction, rounds=0, known_slopes=fit.jacobian)
