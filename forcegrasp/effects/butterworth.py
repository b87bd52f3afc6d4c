"""A low-pass filter of second order, in steps over which what goes in stays as it is."""

from __future__ import annotations

import numpy as np


def butterworth_step(off: np.ndarray, rate: np.ndarray, tau: np.ndarray, dt: float) -> tuple[np.ndarray, np.ndarray]:
    """How far what comes out is off what goes in after a step, and its rate; exactly.

    A mass on a spring whose damper has 1/√2 of the critical damping, so that it rings as fast as it decays (Butterworth
    1930). Without a time constant it is nothing off.

    Args:
      off: how far it is off before the step, of any shape.
      rate: by how much it grows in a second.
      tau: 1/(2π) of the corner's period, seconds, of a shape that broadcasts to that.
      dt: the step, seconds.
    """
    tau = np.broadcast_to(tau, off.shape)
    filters = tau > 0
    decay = np.sqrt(0.5) / np.where(filters, tau, 1.0)
    left = np.where(filters, np.exp(-decay * dt), 0.0)
    cosine, sine = left * np.cos(decay * dt), left * np.sin(decay * dt)
    return cosine * off + sine * (rate / decay + off), cosine * rate - sine * (rate + 2 * decay * off)
