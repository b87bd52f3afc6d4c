"""Looks a little beside where a fit ended: what an effect with a memory of motion does jumps with its size."""

from __future__ import annotations

import numpy as np

from forcegrasp.diagnosis.search.other_starts import costs_without
from forcegrasp.identify.fit import Fit, fit_exactly
from forcegrasp.identify.predict import predict
from forcegrasp.identify.simulators import Simulators
from forcegrasp.identify.target import Target

# Sizes that are looked at, as multiples of the one at which the fit ended.
_MULTIPLES = (0.9, 0.95, 0.98, 1.02, 1.05, 1.1)
# And those of a size that jumps, of which no slope leads nearer.
_FAR_AND_NEAR = tuple(
    1 + sign * share
    for share in (0.3, 0.2, 0.15, 0.1, 0.07, 0.05, 0.03, 0.02, 0.015, 0.01, 0.005, 0.002)
    for sign in (-1, 1)
)
# A size is better if it promises to lower the cost by so much: two standard errors.
_WORTH = 4.0


def look_beside(fit: Fit, target: Target, simulators: Simulators, place: int = -1) -> Fit:
    """The better of a fit and one from a size beside it, for as long as that is better; only of effects that need it.

    A gap that is crossed a sample later lets go of an object a sample later, a threshold drops one command more: the
    cost has a small valley at each, out of which no slope leads. So sizes beside it are simulated, and of what is left
    that is taken out which the other parameters would make up for, as far as slopes tell.

    Args:
      fit: of the model itself.
      target: the measurements.
      simulators: of the problem's grasps.
      place: of the effect among those of the model; the last one by default.
    """
    problem, effect = fit.problem, fit.problem.effects[place].effect
    index = problem.first_entry(place % len(problem.effects))
    while effect.follows_motion or effect.in_steps or effect.in_valleys:
        entry = problem.entries[index]
        sizes = fit.values[index] * np.array(_FAR_AND_NEAR if entry.jumps else _MULTIPLES)
        starts = np.tile(fit.vector, (len(sizes), 1))
        starts[:, index] = [entry.coordinate(size) for size in np.clip(sizes, entry.low, entry.high)]
        cases = [problem.case(start) for start in starts]
        # which commands are dropped is alike in both models
        signals = predict(simulators.cheap, cases) + fit.correction if entry.jumps else predict(simulators.exact, cases)
        costs = costs_without(index, signals, fit, target)
        if costs.min() > fit.cost - _WORTH:
            break
        again = fit_exactly(target, problem, simulators, starts[costs.argmin()], fit.jacobian)
        if again.cost > fit.cost - _WORTH:
            break
        fit = again
    return fit
