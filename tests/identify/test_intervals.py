"""Standard errors, intervals and what a fit warns of."""

from __future__ import annotations

import dataclasses
import re

import numpy as np
import pytest
from scipy.stats import norm

from forcegrasp.identify.fit import Fit
from forcegrasp.identify.intervals import intervals, reached_bound, standard_errors, warnings
from forcegrasp.identify.problem import Problem
from tests.identify.targets import TIAGO, G, S, fit_at, grasp, make, noise, random_slopes

ENTRIES = ("position_gain", "velocity_gain", "rho_m of cup", "force_scale of cup")


def test_standard_errors_of_white_noise():
    slopes = random_slopes(4)
    flat = slopes.reshape(-1, 4)
    expected = np.sqrt(np.diag(np.linalg.inv(flat.T @ flat)))
    assert standard_errors(fit_at(slopes, 0 * noise()), make()) == pytest.approx(expected, rel=1e-6)
    white = standard_errors(fit_at(slopes, noise()), make())
    assert np.all(white >= expected * (1 - 1e-9))
    assert np.all(white < 3 * expected)


def test_standard_errors_see_what_is_correlated_in_a_grasp():
    """A whole grasp that is off is one mishap, not 600."""
    slopes = np.zeros((G, S, 4, 4))
    for signal in range(4):  # each parameter is the level of one signal
        slopes[..., signal, signal] = 50.0
    offset = np.random.default_rng(0).standard_normal((G, 1, 4)) + 0 * noise()
    alone, correlated = (standard_errors(fit_at(slopes, r), make()) for r in (noise(), offset))
    white = 1 / 50 / np.sqrt(G * S)
    assert np.all((alone >= 0.999 * white) & (alone < 2.5 * white))
    of_means = np.linalg.norm(offset[:, 0], axis=0) / 50 / G  # of the mean of G offsets
    assert np.all((correlated >= 0.999 * of_means) & (correlated <= 2.001 * of_means))
    assert np.all(correlated > 3 * alone)


def test_the_interval_of_what_changes_nothing_reaches_as_far_as_its_bounds():
    """A power of an impedance that a scene keeps the same at every depth, in the place of ±0."""
    slopes = random_slopes(4)
    slopes[..., 2] = 0
    fit = fit_at(slopes, noise())
    errors = standard_errors(fit, make())
    assert 1.96 * errors[2] == pytest.approx(fit.problem.high[2] - fit.problem.low[2])
    assert any(line.startswith("rho_m of cup is hardly fixed") for line in warnings(fit, errors))
    assert np.all(errors[[0, 1, 3]] < 0.1)


@pytest.mark.parametrize("memory", [0.0, 0.7, 0.9])
def test_intervals_hold_the_truth_under_noise_with_a_memory(memory):
    """Of 95 % intervals about 95 % do: of a slow and a late response, of one in one grasp, of a fast one in two."""
    rng, grasps, time = np.random.default_rng(1), np.arange(12)[:, None, None], np.arange(100)[None, :, None] / 100
    slopes = np.zeros((12, 100, 4, 4))
    slopes[..., 0] = np.sin(3 * time)
    slopes[..., 1] = (time > 0.4) * (1 - time)
    slopes[..., 2] = (grasps == 0) * np.exp(-(((time - 0.5) / 0.1) ** 2))
    slopes[..., 3] = (grasps < 2) * np.gradient(np.exp(-(((time - 0.3) / 0.02) ** 2)), axis=1)
    inside, draws = np.zeros(4), 300
    for _ in range(draws):
        noise = rng.standard_normal(slopes.shape[:3])
        for sample in range(1, 100):
            noise[:, sample] = memory * noise[:, sample - 1] + np.sqrt(1 - memory**2) * noise[:, sample]
        found = np.linalg.lstsq(slopes.reshape(-1, 4), noise.ravel(), rcond=None)[0]
        errors = standard_errors(fit_at(slopes, noise - slopes @ found), make())
        inside += np.abs(found) < 1.96 * errors
    assert np.all((inside / draws > 0.93) & (inside / draws < 0.99))


def test_standard_errors_see_what_numerical_error_shifts():
    slopes, shift = random_slopes(4), np.array([0.01, -0.02, 0.0, 0.03])
    plain = standard_errors(fit_at(slopes, noise()), make())
    moved = standard_errors(fit_at(slopes, noise()), make(), [slopes @ shift])
    assert moved == pytest.approx(np.sqrt(plain**2 + shift**2), rel=1e-6)


def test_intervals_are_in_the_parameters_own_units_and_bounds():
    fit = fit_at(random_slopes(4), noise(), velocity_gain=-1.2, force_scale=3.0)
    found = dict(zip(ENTRIES, intervals(fit, np.array([0.05, 0.1, 0.02, 100.0])), strict=True))
    low, high = norm.ppf([0.025, 0.975])
    close = {"rel": 1e-4}
    assert found["position_gain"] == pytest.approx((100, 100 * np.exp(low * 0.05), 100 * np.exp(high * 0.05)), **close)
    assert found["velocity_gain"] == pytest.approx((-1.2, -1.2 + low * 0.1 * 9, -1.0), **close)  # its bound
    assert found["rho_m of cup"] == pytest.approx(
        (0.0065, 0.0065 * np.exp(low * 0.02), 0.0065 * np.exp(high * 0.02)), **close
    )
    assert found["force_scale of cup"] == pytest.approx((3.0, 0.05, 30.0))  # nothing fixes it


def test_warnings_are_few_where_all_is_well():
    assert warnings(fit_at(random_slopes(4), noise()), np.full(4, 0.01)) == []


@pytest.mark.parametrize(("value", "bound"), [(30.0, "30"), (300.0, "300")])
def test_warning_at_a_bound(value, bound):
    lines = warnings(fit_at(random_slopes(4), noise(), position_gain=value), np.full(4, 0.01))
    assert lines == [f"position_gain ended at its bound {bound} N/m: doubt the model, or widen it"]


def test_no_warning_where_an_effect_is_simply_not_there():
    fit = fit_at(random_slopes(7), noise(), "stiffening_contact", spring_n=0.0, extra_power=8.0)
    lines = warnings(fit, np.full(7, 0.01))
    assert lines == ["stiffening_contact.extra_power ended at its bound 8: doubt the model, or widen it"]


def test_no_warning_of_a_share_that_is_all_or_nothing():
    fit = fit_at(random_slopes(7), noise(), "finger_creep", at_once_share=0.0)
    assert warnings(fit, np.full(7, 0.01)) == []


def test_warning_of_a_parameter_that_nothing_fixes():
    errors = np.array([0.01, 0.01, 2.0, 0.01])
    assert warnings(fit_at(random_slopes(4), noise()), errors) == ["rho_m of cup is hardly fixed by these data"]


def test_intervals_hold_the_truth_in_95_of_100_sets():
    """A value that is off by its standard error times a normal number, 4,000 times."""
    fit, rng, inside = fit_at(random_slopes(4), noise()), np.random.default_rng(0), []
    errors, truth = np.full(4, 0.01), fit.values
    for _ in range(1000):
        missed = dataclasses.replace(fit, vector=fit.vector + errors * rng.standard_normal(4))
        inside += [low <= t <= high for t, (_, low, high) in zip(truth, intervals(missed, errors), strict=True)]
    assert np.mean(inside) == pytest.approx(0.95, abs=0.012)


def test_hardly_fixed_parameters_are_one_warning():
    errors = np.array([2.0, 2.0, 2.0, 0.01])
    (line,) = warnings(fit_at(random_slopes(4), noise()), errors)
    assert line == "position_gain, velocity_gain and rho_m of cup are hardly fixed by these data"


def test_warning_of_two_that_do_the_same():
    slopes = random_slopes(4)
    slopes[..., 3] = -2 * slopes[..., 2] + 0.3 * slopes[..., 3]
    (line,) = warnings(fit_at(slopes, noise()), np.full(4, 0.1))
    assert re.match(r"rho_m of cup and force_scale of cup are confounded \(correlation 0\.9[89]\d\)", line)


def test_no_warning_of_two_that_do_the_same_and_are_well_known():
    """Correlated as they are, thousands of samples fix each of them."""
    slopes = random_slopes(4)
    slopes[..., 3] = -2 * slopes[..., 2] + 0.3 * slopes[..., 3]
    assert warnings(fit_at(slopes, noise()), np.full(4, 0.01)) == []
    (line,) = warnings(fit_at(slopes, noise()), np.array([0.01, 0.01, 0.01, 0.06]))  # one that is not is enough
    assert "confounded" in line


def test_eleven_pairs_are_one_warning():
    """Softness and force scale of each of eleven objects, and the two gains."""
    problem = Problem(TIAGO, [grasp(i, thing=f"thing {i}") for i in range(11)])
    names = [e.name for e in problem.entries]
    slopes = 50 * np.random.default_rng(3).standard_normal((11, S, 4, len(names)))
    for one, other in [
        ("position_gain", "velocity_gain"),
        *((f"rho_m of thing {i}", f"force_scale of thing {i}") for i in range(11)),
    ]:
        first, second = names.index(one), names.index(other)
        slopes[..., second] = slopes[..., first] + 0.05 * slopes[..., second]
    residual = np.zeros((11, S, 4))
    fit = Fit(problem, problem.start(), residual, residual, slopes, residual, 0.0, 1, np.ones((11, 1, 1)))
    (line,) = warnings(fit, np.full(len(names), 0.1))
    assert line.startswith("position_gain and velocity_gain are confounded (correlation -0.99")
    assert "; rho_m and force_scale are confounded in 11 objects or grasps (correlation up to -0.99" in line
    assert line.endswith(": only together are they fixed")


def test_three_that_go_together_are_one_group():
    covariance = np.eye(4)
    covariance[:3, :3] += 99
    slopes = np.zeros((G, S, 4, 4))
    slopes[0, 0] = np.linalg.cholesky(np.linalg.inv(covariance)).T  # so that their covariance is this one
    (line,) = warnings(fit_at(slopes, noise()), np.full(4, 0.1))
    assert line == (
        "position_gain, velocity_gain and rho_m of cup are confounded (correlation 0.990): only together are they fixed"
    )


def test_what_hardly_changes_anything_is_confounded_with_nothing():
    slopes = np.zeros((G, S, 4, 4))
    slopes[0, 0] = np.diag([300.0, 300.0, 3e-6, 0.0])
    fit = fit_at(slopes, noise())
    assert np.diag(fit.covariance()) == pytest.approx([300.0**-2, 300.0**-2, 3e-6**-2, 0.0])
    assert warnings(fit, np.full(4, 0.1)) == []


@pytest.mark.parametrize(
    ("value", "bounds", "bound"),
    [
        (1.0, (1.0, 9.0, False), 1.0),
        (1.007, (1.0, 9.0, False), 1.0),
        (1.009, (1.0, 9.0, False), None),
        (8.993, (1.0, 9.0, False), 9.0),
        (5.0, (1.0, 9.0, False), None),
        (1.006, (1.0, 1000.0, True), 1.0),
        (1.008, (1.0, 1000.0, True), None),
        (0.0, (0.0, 9.0, False, 0.0), None),  # the effect is not there
        (9.0, (0.0, 9.0, False, 0.0), 9.0),
    ],
)
def test_bounds_that_were_reached(value, bounds, bound):
    assert reached_bound(value, *bounds) == bound
