"""Low-pass filters of first and second order, in steps over which what goes in stays as it is."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Effect

#: Of first order, or of second.
ORDERS = ("", "butterworth")


def low_pass(effect: Effect, value: np.ndarray, held: np.ndarray) -> np.ndarray:
    """What comes out of an effect's filter after a step; its ``rate`` is the effect's state.

    Args:
      effect: with a ``time_constant_s``, and one of :data:`ORDERS` as its variant.
      value: what goes in, ``(rows, width)``.
      held: what came out before, of the same shape.
    """
    if effect.variant == "butterworth":
        rate = effect.state["rate"]
        off, effect.state["rate"] = butterworth_step(held - value, rate, effect["time_constant_s"], effect.dt)
        return value + off
    weight = effect.lag_weight("time_constant_s")
    return np.where(weight == 1, value, held + weight * (value - held))


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
