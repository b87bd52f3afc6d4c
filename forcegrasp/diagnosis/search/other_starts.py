"""Where else a fit with one more effect may start: other sizes of it, and base parameters as they were given."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from forcegrasp.diagnosis.search.refine import as_given
from forcegrasp.diagnosis.signatures import Background
from forcegrasp.diagnosis.study import Study
from forcegrasp.identify.fit import Fit
from forcegrasp.identify.predict import predict
from forcegrasp.identify.target import Target

# Sizes that are looked at, as multiples of the one at which the fit ended.
_MULTIPLES = (0.1, 0.2, 0.35, 0.6, 0.8, 1.25, 1.6, 2.5, 4.0, 8.0)
# So many of the promising ones are fitted.
_MOST = 2
# A time, a frequency or a speed of an effect is tried where it is this far from the fitted one, in logarithms.
_APART = 0.5
# A size is promising if, all else fitted anew as far as slopes tell, at most this share is added to the cost.
_PROMISING = 0.3


def other_starts(fit: Fit, study: Study) -> list[np.ndarray]:
    """Coordinates to start from, each ``(p,)``: the best sizes, twice the size, other shapes, nominal base parameters.

    What rings at 6 Hz has a valley there and others at higher frequencies. Base parameters that made up for the effect
    while it was missing may be stuck where they are. The first parameter of the last effect is set to sizes all over
    its range, each of them simulated by the cheap model. What the other parameters would make up for, as far as their
    slopes tell, is taken out of the residuals.

    Args:
      fit: with an effect as its last one, that left more than noise.
      study: the measurements.
    """
    problem = fit.problem
    index = problem.first_entry(len(problem.effects) - 1)
    entry, size = problem.entries[index], fit.values[index]
    sizes = [s for s in np.unique(np.clip(size * np.array(_MULTIPLES), entry.low, entry.high)) if s != size]
    starts = []
    for value in sizes:
        start = fit.vector.copy()
        start[index] = entry.coordinate(value)
        starts.append(start)
    if not starts:
        return []
    signals = predict(study.simulators.cheap, [problem.case(start) for start in starts]) + fit.correction
    costs = costs_without(index, signals, fit, study.target)
    double = fit.vector.copy()
    double[index] = entry.coordinate(2 * size)
    valleys = [
        i for i, cost in enumerate(costs)
        if cost <= min(costs[max(0, i - 1) : i + 2]) and cost < (1 + _PROMISING) * fit.cost
    ]  # fmt: skip
    ordered = sorted(valleys, key=lambda i: costs[i])[:_MOST]
    return [*(starts[i] for i in ordered), double, *_other_shapes(fit, index), as_given(fit)]


def costs_without(index: int, signals: np.ndarray, fit: Fit, target: Target) -> np.ndarray:
    """Costs of predictions, ``(starts,)``, if all parameters but one make up for what they can, as far as slopes tell.

    Args:
      index: of the parameter that stays.
      signals: predictions near the fit, ``(starts, G, S, C)``.
      fit: whose slopes count.
      target: the measurements.
    """
    priors = fit.problem.priors
    left = np.stack([priors.beside(fit.weight * target.residual(one), fit.vector) for one in signals], axis=1)
    return np.sum(Background(fit, (), without=[index]).remove(left) ** 2, axis=0)


def _other_shapes(fit: Fit, first: int) -> Iterator[np.ndarray]:
    """The fit's coordinates with a time, frequency or speed of its last effect where else the effect is tried.

    Args:
      fit: with the effect as its last one.
      first: index of the effect's first parameter.
    """
    effect = fit.problem.effects[-1].effect
    for place, parameter in enumerate(effect.parameters[1:], 1):
        entry = fit.problem.entries[first + place]
        for value in np.unique(effect.trials()[:, place]) if parameter.logarithmic else ():
            if abs(entry.coordinate(value) - fit.vector[first + place]) > _APART:
                start = fit.vector.copy()
                start[first + place] = entry.coordinate(value)
                yield start
