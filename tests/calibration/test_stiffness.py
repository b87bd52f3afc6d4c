"""ρ changes how force grows, not where it ends; κ changes both."""

from __future__ import annotations

import numpy as np
import pytest

from forcegrasp.calibration import Closing, contact_slope, vary_kappa, vary_rho
from forcegrasp.errors import ConfigError


@pytest.fixture(scope="module")
def by_rho():
    return vary_rho(np.linspace(0.003, 0.010, 8), force_scale=2.0)


def test_slope_falls_with_rho_while_the_final_force_stays(by_rho):
    slopes = contact_slope(by_rho)
    assert (np.diff(slopes) < 0).all()
    assert slopes[0] > 2.5 * slopes[-1]
    np.testing.assert_allclose(by_rho.final_force_n, 0.3 * 2.0, rtol=0.01)


def test_softer_objects_are_pressed_deeper(by_rho):
    assert (np.diff(by_rho.final_position_m) < 0).all()


def test_kappa_changes_slope_and_final_force():
    kappa = np.linspace(0, 1, 5)
    closing = vary_kappa(kappa)
    np.testing.assert_allclose(closing.final_force_n, 0.3 * (5 - 4.5 * kappa), rtol=0.01)  # f = 100 f_α Δq
    slopes = contact_slope(closing)
    assert (np.diff(slopes) < 0).all()
    alone = contact_slope(vary_rho(0.003 + 0.007 * kappa))
    np.testing.assert_allclose(slopes, (5 - 4.5 * kappa) * alone, rtol=0.01)


def test_slope_of_a_line_is_its_own():
    time = np.arange(0, 2, 0.004)
    way = np.clip(time - 0.5, 0, 0.5)[:, None] * [0.004, 0.004]
    closing = Closing(time, 0.03 - way[None], 150 * way[None])
    np.testing.assert_allclose(contact_slope(closing), [150])


def test_nothing_touched_has_no_slope():
    assert np.isnan(contact_slope(vary_rho([0.005], seconds=0.5))).all()


@pytest.mark.parametrize(
    ("kappa", "message"),
    [([0.5, 1.2], r"kappa=1.2: must lie in \[0, 1\]"), (np.nan, "kappa: must be a finite"), ("soft", "kappa: must be")],
)
def test_what_is_no_softness_is_refused(kappa, message):
    with pytest.raises(ConfigError, match=message):
        vary_kappa(kappa)
