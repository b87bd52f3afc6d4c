"""What all steps of a search for missing effects share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from forcegrasp.identify.cross_validation import heldout_residual
from forcegrasp.identify.fit import Fit, Simulators
from forcegrasp.identify.progress import Progress, silent
from forcegrasp.identify.target import Target


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
