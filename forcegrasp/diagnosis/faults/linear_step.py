"""How much of something that the base model lacks there is, by a linear step from its fit."""

from __future__ import annotations

import numpy as np

from forcegrasp.diagnosis.faults.shifted_rows import left_beyond_noise
from forcegrasp.diagnosis.signatures import Background
from forcegrasp.identify.fit import Fit
from forcegrasp.identify.target import Target


def one_of_each(target: Target, channels: slice) -> np.ndarray:
    """What one more of each of these channels, all along, adds to the signals: ``(G, S, C, channels)``."""
    width = channels.stop - channels.start
    always = np.zeros((*target.signals.shape, width))
    always[..., range(channels.start, channels.stop), range(width)] = 1.0
    return always


def linear_step(target: Target, fit: Fit, background: Background, per_unit: np.ndarray) -> tuple[np.ndarray, float]:
    """The sizes that take most off what a fit leaves, and the sum of squares beyond the noise that they leave.

    Args:
      target: the measurements.
      fit: of the base model.
      background: what its parameters follow.
      per_unit: what a unit of each thing adds to the signals, m and N, ``(G, S, C, things)``.
    """
    columns = np.where(target.mask[..., None, None], per_unit / target.sigma[:, None], 0.0)
    clean = background.remove((fit.weight[..., None] * columns).reshape(-1, columns.shape[-1]))
    sizes = np.linalg.lstsq(clean, fit.left, rcond=None)[0]
    return sizes, left_beyond_noise(fit.residual - columns @ sizes, background, target)
