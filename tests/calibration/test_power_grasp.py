"""Fingers close as fast as was measured, and b₂ is found again in a trajectory."""

from __future__ import annotations

import numpy as np
import pytest

from forcegrasp.calibration import close, closing_speed, fit_power_grasp, power_grasps
from forcegrasp.calibration.power_grasp_fit import _least_squares
from forcegrasp.calibration.stiffness import kappa_values
from forcegrasp.errors import ConfigError, ForcegraspError, MeasurementError
from forcegrasp.physics import GraspParameters, GraspSimulator
from forcegrasp.physics.gripper_file import load_gripper

SIGMA_Q_M = 2.7e-5  # paper, appendix


def test_closing_is_that_of_the_simulator():
    closing = close(0.003, 1.0, kappa_values(0.5) | {"velocity_gain": [-13.0, -6.0], "radius_m": 0.02})
    simulator = GraspSimulator(2, threads=1)
    simulator.reset(GraspParameters(np.full(2, 0.5), [-13.0, -6.0], np.full(2, 0.02), np.zeros(2), np.full(2, 0.5)))
    for _ in range(15):  # 0.6 s at rest
        simulator.command(np.full((2, 2), 0.045))
    for step in range(1, 26):
        simulator.step(np.full((2, 2), -0.003))
        sample = int(np.argmin(np.abs(closing.time_s - 0.04 * step)))
        np.testing.assert_array_equal(closing.position_m[:, sample], simulator.joint_position)
        np.testing.assert_array_equal(closing.force_n[:, sample], simulator.force)
    assert (simulator.force[1] > 0.1).all()


def test_samples_are_four_milliseconds_apart_from_the_first_command_on():
    closing = close(0.003, 0.4, touching=False)
    np.testing.assert_allclose(closing.time_s, np.arange(101) * 0.004, atol=1e-12)


def test_closing_speeds_at_full_action():
    np.testing.assert_allclose(closing_speed(power_grasps()), [0.0189, 0.0252, 0.0337], rtol=0.01)
    np.testing.assert_allclose(closing_speed(power_grasps(radius_m=0.025)), [0.0189, 0.0252, 0.0337], rtol=0.01)


@pytest.mark.parametrize("period_s", [0.02, 0.04, 0.08])
def test_speed_follows_from_the_drive_and_the_rate_of_commands(period_s):
    b2 = np.array([-13.0, -6.0])
    law = 100 * 0.003 / (1 - b2 + 100 * period_s / 2)  # kp Δq / (d − b₂ + kp T/2)
    np.testing.assert_allclose(closing_speed(power_grasps(b2, period_s=period_s, tier="fast")), law, rtol=0.04)


def test_without_an_object_the_fingers_close_fully_and_feel_nothing():
    closing = power_grasps([-6.0], seconds=2.0)
    assert (closing.final_position_m < 1e-4).all()
    assert not closing.force_n.any()


def grasp_of(b2: float, rng: np.random.Generator, sigma_m: float = SIGMA_Q_M):
    """A noisy power grasp onto an object, sampled every 12 ms, that starts half a second after its first sample."""
    closing = power_grasps([b2], radius_m=rng.uniform(0.015, 0.025), seconds=2.0)
    time, position = closing.time_s[::3], closing.position_m[0, ::3]
    time = np.concatenate([np.arange(-40, 0) * 0.012, time]) + 0.5
    position = np.concatenate([np.full((40, 2), 0.045), position])
    return time, position + sigma_m * rng.standard_normal(position.shape)


def test_b2_is_found_again():
    rng = np.random.default_rng(5)
    inside = 0
    truths = np.linspace(-13, -6, 8)
    for truth in truths:
        fit = fit_power_grasp(*grasp_of(truth, rng))
        assert not fit.at_bound
        assert 0 < fit.high - fit.low < 0.05
        assert abs(fit.value - truth) < fit.high - fit.low
        assert fit.start_s == pytest.approx(0.5, abs=0.002)
        assert fit.open_m == pytest.approx(0.045, abs=2e-5)
        assert fit.rms_m == pytest.approx(SIGMA_Q_M / np.sqrt(2), rel=0.3)  # of the mean of two fingers
        inside += fit.low <= truth <= fit.high
    assert inside >= 6  # of 8 with probability 0.95 each: fewer with one seed in 170


def test_a_known_start_and_one_finger_will_do():
    time, position = grasp_of(-8.0, np.random.default_rng(1))
    fit = fit_power_grasp(time, position[:, 1], start_s=0.5)
    assert fit.start_s == 0.5
    assert fit.value == pytest.approx(-8.0, abs=0.03)
    assert fit_power_grasp(time, position[:, 1], start_s=0.4).rms_m > 5 * fit.rms_m


def test_the_clock_may_count_from_anywhere():
    time, position = grasp_of(-8.0, np.random.default_rng(1))
    here, there = (fit_power_grasp(time + offset, position) for offset in (0.0, 1.7e9))
    assert there.value == pytest.approx(here.value, abs=0.001)
    assert there.start_s - 1.7e9 == pytest.approx(here.start_s, abs=1e-4)
    np.testing.assert_array_equal(there.time_s, time[: len(there.time_s)] + 1.7e9)


def test_interval_of_a_mean_is_students():
    values = np.tile([1.0, -1.0], 5)  # neighbours are unlike, so that each counts in full
    vector, half = _least_squares(lambda x: x[0] - values, [-3.0], [3.0], [])
    assert vector[0] == pytest.approx(0.0, abs=1e-6)
    assert half == pytest.approx(2.2622 * np.sqrt(10 / 9 / 10), rel=1e-3)  # t of nine degrees of freedom


def test_residuals_in_runs_widen_the_interval():
    rng = np.random.default_rng(2)
    time, position = grasp_of(-9.0, rng, 0.0)
    white = rng.standard_normal(len(time))
    alike = np.convolve(rng.standard_normal(len(time) + 9), np.full(10, np.sqrt(0.1)), "valid")
    narrow, wide = (fit_power_grasp(time, position[:, 0] + SIGMA_Q_M * noise) for noise in (white, alike))
    assert wide.high - wide.low > 2 * (narrow.high - narrow.low)


def test_a_gripper_beyond_its_description_is_said_to_be_at_the_bound():
    time = np.arange(100) * 0.04
    fit = fit_power_grasp(time, 0.045 - np.minimum(0.005 * time, 0.019), start_s=0.0)  # slower than b₂ = −30
    assert fit.at_bound
    assert fit.low <= fit.value <= fit.high
    assert fit.value == pytest.approx(-30)
    assert fit.rms_m > 1e-3


def test_other_grippers_have_other_parameters(root):
    gripper = load_gripper(str(root / "tests/grippers/second.yaml"))
    closing = power_grasps([30.0, 60.0], "joint_damping", gripper=gripper, seconds=2.0)
    assert np.diff(closing_speed(closing)) < 0
    fit = fit_power_grasp(closing.time_s, closing.position_m[0], "joint_damping", gripper=gripper)
    assert fit.value == pytest.approx(30.0, rel=0.01)
    with pytest.raises(ConfigError, match="velocity_gain: second has no such parameter"):
        power_grasps(gripper=gripper)


RISING, FALLING = np.arange(60) * 0.04, np.linspace(0.045, 0.0, 60)


@pytest.mark.parametrize(
    ("time", "position", "message"),
    [
        (RISING, 1e3 * FALLING, "give metres"),
        (1e3 * RISING, FALLING, "give times in seconds"),
        (1e-3 * RISING, FALLING, "give times in seconds"),
        (RISING, FALLING[::-1], "positions fall while closing"),
        (RISING, np.full(60, 0.045), "closed by 0.0 mm"),
        (RISING[::-1], FALLING, "at sample 1 it does not"),
        (RISING[:5], FALLING[:5], "5 samples; at least 10"),
        (RISING[::5], FALLING[::5], "at least 10 are needed"),
        (RISING, np.where(RISING[7] == RISING, np.nan, FALLING), "must be finite"),
        (RISING, FALLING[:50], r"shape \(60,\), positions \(50, 1\)"),
        (RISING, np.zeros((60, 3)), "must be"),
        (["now"] * 60, FALLING, "must be numbers"),
        ([], [], "0 samples"),
    ],
)
def test_what_is_no_power_grasp_is_refused_in_a_line(time, position, message):
    with pytest.raises(MeasurementError, match=message) as caught:
        fit_power_grasp(time, position)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"values": [-9.0, 3.0]}, "velocity_gain=3: must lie in"),
        ({"values": [-9.0, np.nan]}, "velocity_gain: must be a finite number"),
        ({"values": []}, "velocity_gain: must be"),
        ({"values": "fast"}, "velocity_gain: must be a number"),
        ({"parameter": "velocity_gian"}, "did you mean velocity_gain"),
        ({"radius_m": 25}, "radius_m=25: must lie in"),
        ({"delta_m": -0.003}, "delta_m=-0.003: must lie in"),
        ({"delta_m": np.array([0.001, 0.002])}, "got delta_m 2, velocity_gain 3"),
        ({"seconds": 0.0}, "seconds=0: must lie in"),
        ({"seconds": np.inf}, "seconds=inf"),
        ({"period_s": 0.0}, "period_s=0"),
        ({"tier": "quick"}, "reference or fast"),
        ({"start_m": 0.1}, "start_m=0.1: must lie in"),
    ],
)
def test_what_can_not_be_simulated_is_refused_in_a_line(arguments, message):
    with pytest.raises(ForcegraspError, match=message) as caught:
        power_grasps(**arguments)
    assert "\n" not in str(caught.value)


def test_a_start_outside_the_measurement_is_refused():
    with pytest.raises(ConfigError, match="start_s=9: must lie in the measurement"):
        fit_power_grasp(RISING, FALLING, start_s=9.0)
