"""Single readings that are far off everywhere are noise; where they gather something is missing."""

from __future__ import annotations

import numpy as np
import pytest

from forcegrasp.diagnosis.noise.stray_readings import stray_readings, without_spikes

G, S, C = 24, 150, 4
PHASE = np.tile(np.arange(S) // 30, (G, 1))
HALF = np.tile(np.arange(S) % 2, (G, 1))
PARTITIONS = [(PHASE, HALF)] * C


def with_spikes(where: np.ndarray, seed: int = 0) -> np.ndarray:
    """Noise with 40 spikes of 7 σ where there may be any ``(G, S)``."""
    rng = np.random.default_rng(seed)
    residual = rng.standard_normal((G, S, C)).clip(-2.5, 2.5)
    grasps, samples = np.nonzero(where)
    for place in rng.choice(len(grasps), 40, replace=False):
        residual[grasps[place], samples[place], rng.integers(C)] = 7.0
    return residual


@pytest.mark.parametrize("seed", range(5))
def test_here_and_there_they_are_noise(seed):
    residual = with_spikes(np.ones((G, S), bool), seed=seed)
    stray = stray_readings(residual, PARTITIONS)
    assert stray.sum() >= 35  # two side by side are no single ones
    assert (residual[stray] == 7.0).all()


@pytest.mark.parametrize(
    "where",
    [PHASE <= 1, HALF == 0, np.arange(G)[:, None] * np.ones(S) < 6],
    ids=["in two phases", "in one state", "in a quarter of the grasps"],
)
def test_where_they_gather_they_are_none(where):
    assert not stray_readings(with_spikes(where), PARTITIONS).any()


def test_what_lasts_is_none():
    residual, start = np.zeros((G, S, C)), np.arange(G) * 5  # as often in each phase and state
    for length, found in ((1, G), (2, 0)):
        for grasp in range(G):
            residual[grasp, start[grasp] : start[grasp] + length, 0] = 7.0
        assert stray_readings(residual, PARTITIONS).sum() == found


def test_samples_that_there_are_not_count_as_none():
    residual = with_spikes(PHASE < 4)
    residual[:, PHASE[0] == 4] = np.nan
    assert stray_readings(residual, [(np.where(PHASE < 4, PHASE, -1), HALF)] * C).sum() >= 35


def test_a_spike_is_cut_to_its_neighbours_and_what_lasts_is_not():
    residual = np.array([0.5, -30.0, 6.0, 0.0, 3.0, 20.0, 25.0, 21.0, 0.0, 0.0, -9.0])[None, :, None]
    cut = [0.5, -6.0, 6.0, 0.0, 3.0, 20.0, 21.0, 21.0, 0.0, 0.0, -4.0]
    assert without_spikes(residual)[0, :, 0].tolist() == cut
