"""Low-pass filters of first and second order, in steps over which what goes in stays as it is."""

from __future__ import annotations

import numpy as np

from forcegrasp.effects.base import Effect, first_order_weight

#: Of first order, or of second.
ORDERS = ("", "butterworth")


def low_pass(effect: Effect, value: np.ndarray, held: np.ndarray) -> np.ndarray:
    """What comes out of an effect's filter after a step; its ``rate`` is the effect's state.

    ``butterworth`` has 1/√2 of the critical damping, so that it rings as fast as it decays (Butterworth 1930).

    Args:
      effect: with a ``time_constant_s``, and one of :data:`ORDERS` as its variant.
      value: what goes in, ``(rows, width)``.
      held: what came out before, of the same shape.
    """
    if effect.variant == "butterworth":
        tau = effect["time_constant_s"]
        return second_order_low_pass(effect, value, held, np.sqrt(2) * tau, tau)
    return _closer(held, value, effect.lag_weight("time_constant_s"))


def second_order_low_pass(
    effect: Effect, value: np.ndarray, held: np.ndarray, lag: np.ndarray, ringing: np.ndarray
) -> np.ndarray:
    """The same of any filter of second order, with times as of :func:`second_order_step`; where T is 0, of first."""
    swings = ringing > 0
    first = _closer(held, value, first_order_weight(effect.dt, lag))
    off, rate = second_order_step(held - value, effect.state["rate"], lag, np.where(swings, ringing, 1.0), effect.dt)
    effect.state["rate"] = np.where(swings, rate, 0.0)
    return np.where(swings, value + off, first)


def _closer(held: np.ndarray, value: np.ndarray, weight: np.ndarray) -> np.ndarray:
    return np.where(weight == 1, value, held + weight * (value - held))


def second_order_step(
    off: np.ndarray, rate: np.ndarray, lag: np.ndarray, ringing: np.ndarray, dt: float
) -> tuple[np.ndarray, np.ndarray]:
    """How far what comes out is off what goes in after a step, and its rate; exactly: T² x'' + τ x' + x = 0.

    Args:
      off: how far it is off before the step, of any shape.
      rate: by how much it grows in a second.
      lag: τ, seconds, of a shape that broadcasts to that.
      ringing: T, 1/(2π) of the period in which it would ring without damping, seconds, more than 0, of such a shape.
      dt: the step, seconds.
    """
    stiffness, decay = 1 / ringing**2, lag / (2 * ringing**2)
    apart = np.sqrt(decay**2 - stiffness + 0j)  # of the two rates, which are complex where it rings
    fast = -decay - apart
    slow = stiffness / fast
    left, gap = np.exp(slow * dt), np.where(apart == 0, 1.0, 2 * apart)
    kicked = left * np.where(apart == 0, dt, -np.expm1(-gap * dt) / gap)  # what a rate of 1 makes of it
    after = (left - slow * kicked) * off + kicked * rate
    return np.real(after), np.real((left + fast * kicked) * rate - stiffness * kicked * off)
