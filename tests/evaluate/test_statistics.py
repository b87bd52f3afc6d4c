"""Intervals and probabilities, against what is known of normal and constant figures."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm, trim_mean

from forcegrasp.evaluate.statistics import Bootstrap


def test_describe_is_what_numpy_and_scipy_say():
    values = np.random.default_rng(0).normal(3, 2, (4, 50))
    found = Bootstrap(4, 50, seed=1).describe(values)
    assert found["mean"] == pytest.approx(values.mean())
    assert found["std"] == pytest.approx(values.std(ddof=1))
    assert found["iqm"] == pytest.approx(trim_mean(values.reshape(-1), 0.25))
    assert [cell["mean"] for cell in found["by_cell"]] == pytest.approx(list(values.mean(1)))
    assert (found["median"], found["p95"]) == pytest.approx((np.median(values), np.quantile(values, 0.95)))
    assert [cell["median"] for cell in found["by_cell"]] == pytest.approx(list(np.median(values, axis=1)))
    assert [cell["p95"] for cell in found["by_cell"]] == pytest.approx(list(np.quantile(values, 0.95, axis=1)))
    assert found["iqm_low"] < found["iqm"] < found["iqm_high"]


def test_intervals_are_as_wide_as_theory_says():
    values = np.random.default_rng(0).normal(0, 1, (3, 400))
    found = Bootstrap(3, 400, seed=1).describe(values)
    assert found["high"] - found["low"] == pytest.approx(2 * 1.96 / np.sqrt(1200), rel=0.12)
    for cell in found["by_cell"]:
        assert cell["high"] - cell["low"] == pytest.approx(2 * 1.96 / np.sqrt(400), rel=0.15)


def test_intervals_of_quantiles_are_as_wide_as_theory_says():
    """Variance of a sample quantile: p (1 − p) / (n φ(x_p)²), with the density φ at the quantile."""
    values = np.random.default_rng(0).normal(0, 1, (1, 4000))
    found = Bootstrap(1, 4000, seed=1).describe(values)
    for name, share in (("median", 0.5), ("p95", 0.95)):
        width = 2 * 1.96 * np.sqrt(share * (1 - share) / 4000) / norm.pdf(norm.ppf(share))
        assert found[f"{name}_low"] <= found[name] <= found[f"{name}_high"]
        assert found[f"{name}_high"] - found[f"{name}_low"] == pytest.approx(width, rel=0.25)


def test_differences_between_cells_do_not_widen_the_interval():
    values = np.random.default_rng(0).normal(0, 1, (3, 100))
    apart = values + np.array([[0.0], [100.0], [200.0]])
    bootstrap = Bootstrap(3, 100, seed=1)
    one, other = bootstrap.describe(values), bootstrap.describe(apart)
    assert other["high"] - other["low"] == pytest.approx(one["high"] - one["low"], rel=1e-6)


@pytest.mark.parametrize("shift", [-1.0, 0.0, 0.5])
def test_probability_of_improvement_of_normal_figures(shift):
    rng = np.random.default_rng(3)
    values, baseline = rng.normal(shift, 1, (4, 500)), rng.normal(0, 1, (4, 500))
    found = Bootstrap(4, 500, seed=1).improvement(values, baseline)
    assert found["probability"] == pytest.approx(norm.cdf(shift / np.sqrt(2)), abs=0.03)
    assert found["low"] < found["probability"] < found["high"]


def test_the_interval_of_an_improvement_is_of_independent_resamples():
    """Values and baseline are drawn apart from each other: 1.96 standard errors each way, by DeLong et al. (1988)."""
    rng = np.random.default_rng(3)
    baseline = rng.normal(0, 1, (3, 200))
    for values in (baseline + 0.3, rng.normal(0.3, 1, (3, 200))):
        better = (np.sign(values[:, :, None] - baseline[:, None, :]) + 1) / 2
        variance = better.mean(2).var(1, ddof=1) / 200 + better.mean(1).var(1, ddof=1) / 200
        expected = 2 * 1.96 * np.sqrt(variance.sum()) / 3
        found = Bootstrap(3, 200, seed=1).improvement(values, baseline)
        assert found["high"] - found["low"] == pytest.approx(expected, rel=0.12)


def test_ties_count_half_and_certainty_is_certain():
    flat = np.ones((2, 10))
    bootstrap = Bootstrap(2, 10, seed=0)
    assert bootstrap.improvement(flat, flat) == {"probability": 0.5, "low": 0.5, "high": 0.5}
    assert bootstrap.improvement(flat + 1, flat)["low"] == 1.0
    assert bootstrap.describe(flat)["low"] == bootstrap.describe(flat)["high"] == 1.0


def test_the_same_seed_gives_the_same_intervals():
    values = np.random.default_rng(0).normal(size=(2, 20))
    assert Bootstrap(2, 20, 5).describe(values) == Bootstrap(2, 20, 5).describe(values)
    assert Bootstrap(2, 20, 5).describe(values) != Bootstrap(2, 20, 6).describe(values)
