"""Noise with a slow part, as of a filter or of a sensor that wanders, beside a white one."""

from __future__ import annotations

import numpy as np

# Lags from which memory and share are estimated, samples.
_LAGS = 20


def fit_slow_part(values: np.ndarray) -> tuple[float, float]:
    """Memory and share of the slow part of noise whose correlation over k samples is share · memory ** k.

    That is a first-order autoregressive process beside white noise.

    Args:
      values: of variance 1, ``(G, S)``; NaN where there are none.

    Returns:
      Correlation of the slow part with itself one sample before, and its share of the variance; both 0 where readings
      do not lean on the ones before.
    """
    lags = np.arange(1, min(_LAGS, values.shape[1] - 1) + 1)
    correlation = np.array([_mean(values[:, k:] * values[:, :-k]) for k in lags])
    memories = np.linspace(0.01, 0.99, 99)
    shapes = memories[:, None] ** lags
    shares = np.clip(shapes @ correlation / np.sum(shapes**2, axis=1), 0.0, 1.0)
    best = int(np.argmin(np.sum((correlation - shares[:, None] * shapes) ** 2, axis=1)))
    return (float(memories[best]), float(shares[best])) if shares[best] > 0 else (0.0, 0.0)


def innovations(values: np.ndarray, memory: float, share: float) -> np.ndarray:
    """What is new in each value ``(G, S)``, of variance 1: what the best forecast from all before it misses.

    The forecast is a Kalman filter's of the slow part. NaN stays where there are none.
    """
    new, forecast = np.full(values.shape, np.nan), np.zeros(len(values))
    spread = np.full(len(values), share)  # variance of the slow part around its forecast
    for sample in range(values.shape[1]):
        there = np.isfinite(values[:, sample])
        error, total = values[there, sample] - forecast[there], spread[there] + 1 - share
        new[there, sample] = error / np.sqrt(total)
        gain = spread[there] / total
        forecast[there] += gain * error
        spread[there] *= 1 - gain
        forecast, spread = memory * forecast, memory**2 * spread + (1 - memory**2) * share
    return new


def through_filter(signatures: np.ndarray, memory: np.ndarray, share: np.ndarray, samples: int) -> np.ndarray:
    """Signatures ``(G · samples · C, k)`` that meet white noise as these meet noise with a slow part.

    Args:
      signatures: of effects.
      memory, share: of each signal's noise, ``(C,)``, see :func:`fit_slow_part`.
      samples: per grasp.
    """
    # Noise of both parts is white noise that goes through a filter with one pole, the memory, and one zero.
    ratio = -memory * (1 - share) / (1 + memory**2 - 2 * memory**2 * share)  # zero ÷ (1 + zero²)
    zero = 2 * ratio / (1 + np.sqrt(np.maximum(1 - 4 * ratio**2, 0.0)))
    pole, step = memory.astype(np.float32), (memory + zero).astype(np.float32)
    size = np.sqrt((1 - memory**2) / (1 - memory**2 + (memory + zero) ** 2)).astype(np.float32)
    out = signatures.reshape(-1, samples, len(memory), signatures.shape[1]).copy()
    later = np.zeros_like(out[:, 0])
    for sample in reversed(range(samples)):
        now = out[:, sample].copy()
        out[:, sample] = size[:, None] * (now + step[:, None] * later)
        later = now + pole[:, None] * later
    return out.reshape(signatures.shape)


def _mean(values: np.ndarray) -> float:
    there = np.isfinite(values)
    return float(values[there].mean()) if there.any() else 0.0
