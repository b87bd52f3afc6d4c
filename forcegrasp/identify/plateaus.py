"""Sizes of effects that jump: between two jumps nothing changes, and no slope tells how far that is."""

from __future__ import annotations

from weakref import WeakKeyDictionary

import numpy as np

from forcegrasp.identify.fit import Fit
from forcegrasp.identify.predict import predict
from forcegrasp.identify.simulators import cheap_tier
from forcegrasp.identify.target import Target
from forcegrasp.replay.replay import Replay

# Sizes that are looked at to either side, as shares of the fitted one.
_SHARES = (0.001, 0.002, 0.005, 0.01, 0.015, 0.02, 0.03, 0.05, 0.1, 0.2)
# A size is as good if it raises the cost by no more than this: two standard errors.
_AS_GOOD = 4.0
# What is known of fits: intervals of the terminal, the report and the model file are the same.
_KNOWN: WeakKeyDictionary[Fit, tuple[Target, np.ndarray]] = WeakKeyDictionary()


def plateaus(fit: Fit, target: Target) -> np.ndarray:
    """How far each coordinate lies from the next one that surely leaves more, ``(p,)``; 0 where slopes tell.

    A threshold that decides command by command may be anywhere between two of them. Sizes to either side are simulated
    by the cheap model, and the others stay as they are.

    Args:
      fit: of a model.
      target: the measurements.
    """
    if (known := _KNOWN.get(fit)) is not None and known[0] is target:
        return known[1]
    found, problem, replay = np.zeros(len(fit.problem)), fit.problem, None
    for index, entry in enumerate(problem.entries):
        if not entry.jumps or fit.values[index] == 0:
            continue
        replay = replay or Replay(problem.gripper, problem.grasps, cheap_tier(problem.gripper))
        found[index] = _half_width(fit, target, replay, index)
    _KNOWN[fit] = target, found
    return found


def _half_width(fit: Fit, target: Target, replay: Replay, index: int) -> float:
    """The larger distance, in coordinates, to the nearest size below and above that leaves more."""
    entry, size, sides = fit.problem.entries[index], fit.values[index], np.array([-1.0, 1.0])
    sizes = np.clip(size * (1 + sides[:, None] * np.array(_SHARES)), entry.low, entry.high)
    vectors = np.tile(fit.vector, (sizes.size, 1))
    vectors[:, index] = [entry.coordinate(one) for one in sizes.ravel()]
    signals = predict(replay, [fit.problem.case(one) for one in vectors]) + fit.correction
    of_priors = fit.problem.priors.cost(fit.vector)
    costs = np.array([np.sum((fit.weight * target.residual(one)) ** 2) + of_priors for one in signals])
    worse = (costs > fit.cost + _AS_GOOD).reshape(sizes.shape)
    first = np.where(worse.any(axis=1), worse.argmax(axis=1), len(_SHARES) - 1)
    ends = vectors[:, index].reshape(sizes.shape)[np.arange(len(sides)), first]
    return float(np.abs(ends - fit.vector[index]).max())
