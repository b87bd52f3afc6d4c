"""What all steps of a search for missing effects share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from forcegrasp.identify.cross_validation import heldout_residual, log_likelihood
from forcegrasp.identify.fit import Fit, Simulators
from forcegrasp.identify.progress import Progress, silent
from forcegrasp.identify.target import Target

# Fewer held-out recordings say nothing of how much they scatter.
_RECORDINGS = 3


@dataclass(frozen=True, eq=False)
class Study:
    """The measurements, and what they are simulated and judged with."""

    target: Target
    simulators: Simulators
    folds: Sequence[np.ndarray]  #: indices of the grasps that are held out together
    numerical: Sequence[np.ndarray] = ()  #: the model's own numerical errors, which no effect gets credit for
    progress: Progress = silent

    def heldout(self, fit: Fit) -> np.ndarray:
        """Residuals of held-out grasps, ``(G, S, C)``."""
        return heldout_residual(fit, self.target, self.folds)

    def gains(self, before: np.ndarray, after: np.ndarray) -> np.ndarray:
        """By how much each grasp's held-out log-likelihood rises, ``(G,)``; NaN of those that were not held out.

        Windows of one recording err alike: of three recordings held out, and more, there is one figure each, ``(R,)``.

        Args:
          before: residuals of held-out grasps under one fit, ``(G, S, C)``.
          after: the same under another.
        """
        weight, recordings = self.target.weight, self.target.recordings
        gains = log_likelihood(weight * after) - log_likelihood(weight * before)
        gains[~np.isfinite(before).any(axis=(1, 2))] = np.nan
        held = [gains[members][np.isfinite(gains[members])] for members in recordings.values()]
        sums = [one.sum() for one in held if len(one)]
        return np.array(sums) if len(sums) >= _RECORDINGS else gains
