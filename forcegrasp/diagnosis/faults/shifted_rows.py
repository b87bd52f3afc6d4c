"""What a fit of the base model leaves once some readings are taken for those of another row."""

from __future__ import annotations

import dataclasses

import numpy as np

from forcegrasp.diagnosis.signatures import Background
from forcegrasp.identify.fit import Fit
from forcegrasp.identify.target import Target

#: A row's shift is worth a fit if it takes this share off the squares that a fit leaves beyond the noise.
WORTH_A_FIT = 0.5


def left_beyond_noise(residual: np.ndarray, background: Background, target: Target) -> float:
    """The sum of squares beyond the noise in residuals ``(G, S, C)`` that no parameter follows."""
    clean = background.remove(residual.ravel())
    return float(clean @ clean) - target.readings


def left_by_shift(target: Target, fit: Fit, background: Background, channels: list[int], later: bool) -> float:
    """The sum of squares beyond the noise that no parameter follows, with the readings of these channels shifted.

    Args:
      target: the measurements.
      fit: of the base model.
      background: what its parameters follow.
      channels: of the signals that are shifted; none leave all as they are.
      later: whether what was read stands one row later then, or one row earlier.
    """
    signals, (to, of) = target.signals.copy(), (slice(1, None), slice(None, -1))
    if not later:
        to, of = of, to
    signals[:, to, channels] = target.signals[:, of, channels]
    shifted = dataclasses.replace(target, signals=signals).residual(fit.predicted)
    return left_beyond_noise(shifted, background, target)
