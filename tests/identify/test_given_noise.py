"""Noise that is given is told or refused where the readings contradict it, and left alone where they can't tell."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path

import numpy as np
import pytest

from forcegrasp.errors import MeasurementError
from forcegrasp.identify.sensor_noise import check_given_noise, noise_range
from forcegrasp.measure import MeasuredGrasp, MeasurementSet

SIGMA_M, SIGMA_N = 3e-5, 0.02


def grasp(seed: int, rate: float = 25.0, seconds: float = 6.0, std=(SIGMA_M, SIGMA_N)) -> MeasuredGrasp:
    """Closes in 1 s, holds until 4 s, opens in 1 s; forces follow how far the fingers are from the object."""
    draw, time = np.random.default_rng(seed), np.arange(int(seconds * rate)) / rate
    command = np.interp(time, [0.4, 1.4, 4.0, 5.0], [0.045, 0.02, 0.02, 0.045])
    pair = np.repeat(command[:, None], 2, axis=1)
    force = np.maximum(0.025 - pair, 0) * 200
    noise = draw.standard_normal((2, len(time), 2))
    return MeasuredGrasp(
        f"g{seed}", "o", "s", 0.02, 0.0, None, time, pair, pair + std[0] * noise[0], force + std[1] * noise[1], None
    )


def given(grasps, position: float | None = SIGMA_M, force: float | None = SIGMA_N) -> MeasurementSet:
    return MeasurementSet(Path("set"), "set", "tiago", "", "", position, force, tuple(grasps), "")


def forces(grasps, change) -> list[MeasuredGrasp]:
    return [dataclasses.replace(g, force_n=change(g.force_n, np.random.default_rng(i))) for i, g in enumerate(grasps)]


@pytest.fixture(scope="module")
def grasps() -> list[MeasuredGrasp]:
    return [grasp(seed) for seed in range(8)]


@pytest.mark.parametrize("factor", [0.01, 0.09, 0.5, 0.8, 1.0, 1.25, 2.0, 9.0, 12.0, 1e3, 1e300])
@pytest.mark.parametrize("key", ["position_std_m", "force_std_n"])
def test_factor(grasps, key, factor):
    """As many times the noise that the readings have."""
    sigma = {"position_std_m": SIGMA_M, "force_std_n": SIGMA_N}[key]
    measured = dataclasses.replace(given(grasps), **{key: sigma * factor})
    if 0.1 < factor < 10:
        warnings = check_given_noise(measured)
        assert len(warnings) == (not 1 / 1.5 < factor < 1.5)
        assert all(f"set/meta.yaml: {key}: {sigma * factor:.3g} " in warning for warning in warnings)
    else:
        todo = "is it in m" if factor == 1e3 else "correct"
        with pytest.raises(MeasurementError, match=rf"set/meta.yaml: {key}: .* is given, the readings show .*; {todo}"):
            check_given_noise(measured)


@pytest.mark.parametrize(
    ("factor", "words"), [(1e-3, "are the readings in mN? give them in N"), (1e3, "is it in mN? give it in N")]
)
def test_a_unit_without_its_prefix_is_told(grasps, factor, words):
    with pytest.raises(MeasurementError, match=rf"force_std_n: .*{re.escape(words)}$"):
        check_given_noise(given(grasps, SIGMA_M, SIGMA_N * factor))


def test_what_is_shown_is_the_noise(grasps):
    least, most = noise_range(tuple(grasps), [g.force_n for g in grasps])
    assert 0.85 * SIGMA_N < least < most < 1.2 * SIGMA_N


#: Readings that hide their noise, or some of it; none of them is odd.
HIDDEN = {
    "steps of a converter": lambda force, draw: 0.1 * np.round(force / 0.1),
    "fine steps": lambda force, draw: 0.03 * np.round(force / 0.03),
    "a dead zone": lambda force, draw: np.maximum(force - 0.3, 0),
    "a stop": lambda force, draw: np.minimum(force, 0.2),
    "a deaf finger": lambda force, draw: force * [1, 0],
    "a finger with a tenth of the noise": lambda force, draw: force * [1, 0.1],
    "spikes": lambda force, draw: force + 9.0 * (draw.random(force.shape) < 0.02),
    "drift": lambda force, draw: force + np.linspace(0, 1, len(force))[:, None],
    "heavy tails": lambda force, draw: force + SIGMA_N * (draw.standard_t(4, force.shape) / 2 - 0.5),
}


@pytest.mark.parametrize("case", HIDDEN)
def test_nothing_odd(grasps, case):
    assert check_given_noise(given(forces(grasps, HIDDEN[case]))) == []


def test_no_refusal_without_noise_or_enough_readings(grasps):
    silent = [grasp(seed, std=(0.0, 0.0)) for seed in range(8)]
    for std in (1e-9, 0.013, 0.5):
        check_given_noise(given(silent, std, std))
    assert check_given_noise(given(silent, None, None)) == []
    assert check_given_noise(given([grasp(0, seconds=1.0)], 1.0, 100.0)) == []


@pytest.mark.parametrize("rate", [25.0, 100.0, 500.0])
def test_noise_that_a_filter_made_slow_is_not_refused(rate):
    """A first-order filter of 0.1 s; what is given is the standard deviation that is left."""
    keep = np.exp(-1 / (0.1 * rate))

    def slow(force, draw):
        noise = np.zeros_like(force)
        for i in range(1, len(force)):
            noise[i] = keep * noise[i - 1] + np.sqrt(1 - keep**2) * SIGMA_N * draw.standard_normal(2)
        return force + noise

    assert len(check_given_noise(given(forces([grasp(s, rate, std=(SIGMA_M, 0.0)) for s in range(4)], slow)))) <= 1


def test_a_command_that_never_rests_shows_no_least_noise():
    """Vibration of 2 Hz and 10 mm, sampled at 25 Hz, is no noise."""
    moving = []
    for seed in range(8):
        g = grasp(seed)
        wave = 0.03 + 0.01 * np.sin(2 * np.pi * 2 * g.time_s)[:, None] * np.ones(2)
        moving.append(dataclasses.replace(g, command_m=wave, position_m=wave + g.position_m - g.command_m))
    assert check_given_noise(given(moving)) == []
