"""How far what a set gives, and how exactly, may lead a fit."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from forcegrasp.identify import givens
from forcegrasp.identify.fit_set import fit_model
from forcegrasp.identify.givens import Given, errors_by_givens
from forcegrasp.identify.intervals import chance_errors, numerical_shifts, standard_errors
from forcegrasp.identify.progress import silent
from tests.identify.targets import G, fit_at, make, noise, random_slopes
from tests.light_set import light_set


@pytest.mark.parametrize("given", [1, 3])
def test_they_widen_intervals_as_a_fit_of_all_together_would(given, monkeypatch):
    """With what is given as further parameters, each with a prior of its standard deviation."""
    slopes = random_slopes(4)
    alike = 5 * slopes[..., :given] + np.random.default_rng(1).standard_normal((*slopes.shape[:3], given)) / 50
    flat = np.concatenate([slopes, alike], axis=-1).reshape(-1, 4 + given)
    together = np.linalg.inv(flat.T @ flat + np.diag([0.0] * 4 + [1.0] * given))
    some = tuple(Given("radius_m", str(i), 1e-4, np.ones(G, bool)) for i in range(given))
    monkeypatch.setattr(givens, "givens_of", lambda measured, target: some)
    monkeypatch.setattr(givens, "given_slopes", lambda target, fit, of: alike.reshape(-1, given))
    fit = fit_at(slopes, noise())
    errors = errors_by_givens(fit, make(), None)  # pyright: ignore[reportArgumentType]
    added = np.sum(numerical_shifts(fit, errors) ** 2, axis=0)
    assert added == pytest.approx(np.diag(together)[:4] - np.diag(fit.covariance()), rel=1e-4)
    assert added[0] > 10 * fit.covariance()[0, 0]


def test_what_is_given_exactly_leads_nowhere():
    """And a tolerance of the time of reading makes parameters less certain."""
    loaded = light_set(grasps=6)
    target, _, base = fit_model(loaded, 0, silent)
    exact = dict.fromkeys(("radius_std_m", "offset_std_m", "period_std_share", "delay_std_s"), 0.0)
    measured = dataclasses.replace(loaded.measured, **exact)
    assert errors_by_givens(base.fit, target, measured) == []
    late = errors_by_givens(base.fit, target, dataclasses.replace(measured, delay_std_s=0.002))
    assert len(late) == 2  # of all readings, and of forces beside positions
    wider = standard_errors(base.fit, target, late) / chance_errors(base.fit)
    assert wider.min() >= 1
    assert wider.max() > 1.05
