"""Sensor noise of several kinds, in units of the standard deviation that a set states."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

Draw = Callable[[np.random.Generator, tuple[int, ...]], np.ndarray]  # of shape (..., samples, 2)


def _none(rng: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
    return np.zeros(shape)


def _white(rng: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
    return rng.normal(size=shape)


def _heavy(rng: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
    """Student's t with three degrees of freedom, of variance 1."""
    return rng.standard_t(3, shape) / np.sqrt(3)


def _slow(rng: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
    """Each sample keeps 0.7 of the one before; of variance 1."""
    fresh = rng.normal(size=shape)
    kept = fresh.copy()
    for k in range(1, shape[-2]):
        kept[..., k, :] = 0.7 * kept[..., k - 1, :] + np.sqrt(1 - 0.7**2) * fresh[..., k, :]
    return kept


def _outliers(rng: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
    """One reading in 300 is eight times as far off."""
    return rng.normal(size=shape) * np.where(rng.random(shape) < 1 / 300, 8.0, 1.0)


NOISES: dict[str, Draw] = {
    "none": _none,
    "white": _white,
    "heavy": _heavy,
    "slow": _slow,
    "outliers": _outliers,
    "louder": lambda rng, shape: 1.5 * _white(rng, shape),
    "quieter": lambda rng, shape: 0.7 * _white(rng, shape),
}
