"""Estimates from several sets: against published figures, and against what is drawn."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm

from forcegrasp.identify.random_effects import holm, p_alike, shared_value, spread_between

# Thirteen trials of the BCG vaccine (Colditz et al. 1994): log risk ratios and their variances, as in R's metafor.
LOG_RATIO = np.array([-0.8893, -1.5854, -1.3481, -1.4416, -0.2175, -0.7861, -1.6209, 0.0120, -0.4694, -1.3713, -0.3394,
                      0.4459, -0.0173])  # fmt: skip
VARIANCE = np.array([0.3256, 0.1946, 0.4154, 0.0200, 0.0512, 0.0069, 0.2230, 0.0040, 0.0564, 0.0730, 0.0124, 0.5325,
                     0.0714])  # fmt: skip


def test_the_spread_is_that_of_published_trials():
    found, low, high = np.square(spread_between(LOG_RATIO, np.sqrt(VARIANCE)))
    assert found == pytest.approx(0.318, abs=2e-3)  # metafor: method="PM"
    assert (low, high) == pytest.approx((0.120, 1.112), abs=2e-3)  # confint(), the Q-profile
    assert p_alike(LOG_RATIO, np.sqrt(VARIANCE)) < 1e-4  # Q = 152.2, 12 degrees of freedom


def test_two_estimates_are_told_apart_by_their_difference():
    values, errors = np.array([1.0, 1.5]), np.array([0.1, 0.2])
    assert p_alike(values, errors) == pytest.approx(2 * norm.sf(0.5 / np.hypot(0.1, 0.2)))


def test_probabilities_are_corrected_for_their_number_in_steps():
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert holm([0.9, 0.8]) == pytest.approx([1.0, 1.0])
    assert not len(holm([]))


def test_sets_that_scatter_no_more_than_their_errors_have_no_spread():
    for values in ([1.0, 1.01, 0.99], [1.0, 1.0, 1.0]):
        found, low, high = spread_between(np.array(values), np.array([0.1, 0.1, 0.1]))
        assert (found, low) == (0.0, 0.0)
        assert high == pytest.approx(0.1 * np.sqrt(2 / 0.0506 - 1), rel=1e-3)


@pytest.mark.parametrize("spread", [0.0, 0.3])
def test_the_interval_of_all_holds_what_the_sets_are_drawn_about(spread):
    rng, errors, held = np.random.default_rng(0), np.array([0.1, 0.2, 0.15]), 0
    for _ in range(400):
        values = 2.0 + spread * rng.standard_normal(3) + errors * rng.standard_normal(3)
        _, low, high = shared_value(values, errors, spread_between(values, errors)[0])
        held += low <= 2.0 <= high
    assert held / 400 > 0.92


def test_what_all_have_alike_is_in_no_mean_averaged_out():
    values, errors = np.array([1.0, 1.0]), np.array([0.1, 0.1])
    _, low, high = shared_value(values, errors)
    assert high - low == pytest.approx(2 * 1.96 * 0.1 / np.sqrt(2))
    _, low, high = shared_value(values, errors, common=1.0)
    assert high - low == pytest.approx(2 * 1.96 * np.hypot(1.0, 0.1 / np.sqrt(2)))
