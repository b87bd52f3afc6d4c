"""What effects have in common of which each finger has its own share."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Effect, Parameter

#: The left finger has more, and the right one less.
SIDES = np.array([1.0, -1.0])
#: By how much.
SHARE = Parameter("share", "share a by which the left one has more", "1", -1.0, 1.0, 0.5, null=0.5, trials=(-1.0, 1.0))


def of_each(effect: Effect, mean: str) -> np.ndarray:
    """What each finger has of a parameter that is the mean of both, ``(rows, 2)``."""
    return effect[mean] * (1 + effect["share"] * SIDES)
