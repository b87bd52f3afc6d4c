"""Final forces grow by 100 f_α per metre of Δq, and from a slope the f_α comes out."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from scipy.stats import linregress

from forcegrasp.calibration import match_force_scale, regress, staircase
from forcegrasp.calibration.staircase import DELTAS_M
from forcegrasp.errors import ConfigError, MeasurementError
from forcegrasp.physics import default_gripper
from forcegrasp.physics.gripper_file import load_gripper

KAPPA = np.array([0.0, 0.4, 1.0])


@pytest.fixture(scope="module")
def stairs():
    return staircase(KAPPA, seconds=4.0)


def test_final_force_is_the_static_law(stairs):
    np.testing.assert_allclose(stairs.delta_m, np.arange(1, 11) * 0.0003)
    law = 100 * default_gripper().training.force_scale(KAPPA)[:, None] * stairs.delta_m
    np.testing.assert_allclose(stairs.force_n, law, rtol=0.01)


def test_slope_is_that_of_the_law(stairs):
    for slope, scale in zip(stairs.slopes, default_gripper().training.force_scale(KAPPA), strict=True):
        assert slope.n_per_m == pytest.approx(100 * scale, rel=0.01)
        assert slope.low <= slope.n_per_m <= slope.high
        assert abs(slope.offset_n) < 0.002


def test_tiers_agree(stairs):
    fast = staircase(KAPPA, seconds=4.0, tier="fast")
    np.testing.assert_allclose(fast.force_n, stairs.force_n, rtol=0.01)


def test_force_scale_is_found_again():
    truth = 3.1
    unit, hidden = staircase(values={"force_scale": [1.0, truth]}, deltas_m=DELTAS_M[::2], tier="fast").slopes
    assert match_force_scale(hidden.n_per_m, unit.n_per_m) == pytest.approx(truth, rel=1e-3)


def test_slopes_of_the_paper():
    # The law's 100 N/m per f_α: sponge and wood differ by less than a tenth of the interval [0.5, 5].
    scales = match_force_scale([278.0, 330.0], 100.0)
    np.testing.assert_allclose(scales, [2.78, 3.30])
    np.testing.assert_allclose(
        default_gripper().training.kappa_of_force_scale(scales), [(5 - 2.78) / 4.5, (5 - 3.30) / 4.5]
    )


def test_kappa_and_force_scale_are_inverse():
    kappa = np.linspace(0, 1, 11)
    np.testing.assert_allclose(
        default_gripper().training.kappa_of_force_scale(default_gripper().training.force_scale(kappa)),
        kappa,
        atol=1e-12,
    )
    np.testing.assert_array_equal(default_gripper().training.kappa_of_force_scale(np.array([0.1, 9.0])), [1.0, 0.0])


def test_regression_is_least_squares_with_an_interval_of_the_right_size():
    rng, inside = np.random.default_rng(3), 0
    for _ in range(60):
        force = 280 * DELTAS_M - 0.03 + 0.03 * rng.standard_normal(10)
        slope, other = regress(DELTAS_M, force), linregress(DELTAS_M, force)
        assert slope.n_per_m == pytest.approx(other.slope)
        assert slope.offset_n == pytest.approx(other.intercept)
        inside += slope.low <= 280 <= slope.high
    assert 48 <= inside <= 60  # resampling ten residuals is a little narrow: about 0.92


def test_other_gripper(root):
    gripper = load_gripper(str(root / "tests/grippers/second.yaml"))
    given = {"servo_stiffness": [200.0, 400.0], "radius_m": 0.02}
    soft, stiff = staircase(values=given, gripper=gripper, deltas_m=DELTAS_M[3:], seconds=3.0).slopes
    assert soft.n_per_m == pytest.approx(200, rel=0.01)
    assert stiff.n_per_m == pytest.approx(400, rel=0.01)


def test_objects_of_any_radius_and_place():
    values = {"radius_m": [0.018, 0.03], "offset_m": [0.004, -0.01], "force_scale": 1.0}
    stairs = staircase(values=values, deltas_m=[0.001, 0.002, 0.003], tier="fast")
    np.testing.assert_allclose(stairs.force_n, [[0.1, 0.2, 0.3]] * 2, rtol=0.01)


def test_fingers_start_a_millimetre_from_an_object_off_the_middle(monkeypatch):
    started = {}

    def note_the_start(*_, start_m, **__):
        started["m"] = start_m
        raise KeyboardInterrupt

    monkeypatch.setattr(sys.modules["forcegrasp.calibration.staircase"], "close", note_the_start)
    with pytest.raises(KeyboardInterrupt):
        staircase(values={"radius_m": 0.02, "offset_m": [0.0, 0.004, -0.01]}, deltas_m=[0.001])
    np.testing.assert_allclose(started["m"], [0.021, 0.025, 0.031])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({}, "kappa, or their values"),
        ({"kappa": 0.5, "values": {"rho_m": 0.005}}, "and not both"),
        ({"kappa": -0.1}, "kappa=-0.1"),
        ({"kappa": 0.5, "deltas_m": [0.0, 0.001]}, "delta_m=0: must lie in"),
        ({"kappa": 0.5, "deltas_m": []}, "deltas_m: must be"),
        ({"values": {"rho": 0.005}}, "did you mean rho_m"),
        ({"values": {"rho_m": [0.004, 0.005], "force_scale": [1, 2, 3]}}, "got rho_m 2, force_scale 3"),
        ({"kappa": 0.5, "deltas_m": [0.0003, 0.001], "seconds": 0.5}, "have not settled"),
    ],
)
def test_what_is_no_staircase_is_refused(arguments, message):
    with pytest.raises(ConfigError, match=message) as caught:
        staircase(**arguments)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("delta", "force", "message"),
    [
        (DELTAS_M, DELTAS_M[:5], "must be as many"),
        (DELTAS_M, np.full(10, np.nan), "finite"),
        (DELTAS_M[:3], DELTAS_M[:3], "3 different deltas"),
        (np.full(10, 0.001), DELTAS_M, "1 different deltas"),
        ("wood", "hard", "must be numbers"),
    ],
)
def test_what_is_no_table_is_refused(delta, force, message):
    with pytest.raises(MeasurementError, match=message):
        regress(delta, force)


def test_a_slope_of_nothing_is_refused():
    with pytest.raises(ConfigError, match="per_force_scale_n_m=0"):
        match_force_scale(278.0, 0.0)
