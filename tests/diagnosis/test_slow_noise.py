"""Noise with a slow part beside a white one."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from forcegrasp.diagnosis.noise.slow_noise import fit_slow_part, innovations, through_filter


def noise(memory: float, share: float, grasps: int = 200, samples: int = 150) -> np.ndarray:
    white, new = np.random.default_rng(1).standard_normal((2, grasps, samples + 300))
    slow = lfilter([np.sqrt(1 - memory**2)], [1, -memory], new, axis=1)
    return (np.sqrt(1 - share) * white + np.sqrt(share) * slow)[:, 300:]


@pytest.mark.parametrize(("memory", "share"), [(0.7, 1.0), (0.9, 0.3), (0.95, 0.5)])
def test_both_parts_are_found_and_what_is_new_is_white(memory, share):
    values = noise(memory, share)
    values[:, ::7] = np.nan
    assert fit_slow_part(values) == pytest.approx((memory, share), abs=0.03)
    new = innovations(values, memory, share)
    assert np.isnan(new[:, ::7]).all()
    assert np.nanvar(new) == pytest.approx(1, abs=0.02)
    for lag in (1, 2, 5, 20):
        assert abs(np.nanmean(new[:, lag:] * new[:, :-lag])) < 0.02


def test_white_noise_has_no_slow_part():
    white = np.random.default_rng(0).standard_normal((200, 150))
    memory, share = fit_slow_part(white)
    assert memory * share < 0.02
    np.testing.assert_allclose(innovations(white, 0.0, 0.0), white)


def test_a_signature_meets_filtered_white_noise_as_it_meets_the_noise_itself():
    rng, samples = np.random.default_rng(3), 60
    memory, share = np.array([0.9, 0.0, 0.6]), np.array([0.4, 0.0, 1.0])
    signature = rng.standard_normal((1, samples, 3)).cumsum(axis=1)
    filtered = through_filter(signature.reshape(-1, 1), memory, share, samples).reshape(samples, 3)
    for k in range(3):
        lags = np.abs(np.subtract.outer(np.arange(samples), np.arange(samples)))
        covariance = share[k] * memory[k] ** lags + (1 - share[k]) * np.eye(samples)
        variance = signature[0, :, k] @ covariance @ signature[0, :, k]
        # the filter begins in the first sample, where the process has gone on for ever
        assert np.sum(filtered[:, k] ** 2) == pytest.approx(variance, rel=0.1)
