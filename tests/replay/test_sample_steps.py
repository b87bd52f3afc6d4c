"""Physics steps share the time between two samples, whole ones, where time stamps scatter."""

from __future__ import annotations

import numpy as np
import pytest

from forcegrasp.effects import get_effect
from forcegrasp.measure import MeasuredGrasp
from forcegrasp.physics.gripper_file import load_gripper
from forcegrasp.replay.replay import EffectOn, Replay
from forcegrasp.replay.sample_steps import place_samples

DT, REGULAR = 0.002, np.arange(30) * 0.04
JITTER = np.random.default_rng(3).uniform(-0.003, 0.003, 30) * (REGULAR > 0)


def grasp(time: np.ndarray) -> MeasuredGrasp:
    """Closes and opens at 60 mm a second, and touches nothing."""
    command = np.interp(time - time[0], [0.0, 0.4, 0.6, 1.2], [0.045, 0.021, 0.021, 0.045])[:, None] + [0.0, 0.0]
    return MeasuredGrasp("g", "o", "", None, None, None, time, command, command, 0 * command, None)


def times_of(placed, grasps) -> list[np.ndarray]:
    """When samples are taken, by the lengths of the steps before them."""
    lengths = placed.lengths(1 + max(start[-1] for start in placed.starts))
    steps = np.repeat(lengths, placed.at_once, axis=0)
    after = np.vstack([np.zeros((1, len(grasps))), np.cumsum(steps, axis=0)]) * DT
    return [after[start, index] for index, start in enumerate(placed.starts)]


def test_even_samples_are_at_whole_steps_of_the_usual_length():
    placed = place_samples([grasp(REGULAR + 5.0), grasp(REGULAR[:9])], DT)
    assert [one.tolist() for one in placed.starts] == [(20 * np.arange(n)).tolist() for n in (30, 9)]
    assert placed.lengths(1000) is None


@pytest.mark.parametrize("missing", [[], [7], [11, 12]])
def test_steps_between_two_samples_share_the_time_that_passes(missing):
    kept = np.delete(np.arange(30), missing)
    grasps = [grasp((REGULAR + JITTER)[kept]), grasp(REGULAR[:12])]
    placed = place_samples(grasps, DT)
    assert placed.at_once == 20
    assert placed.starts[0].tolist() == (20 * kept).tolist()
    for times, one in zip(times_of(placed, grasps), grasps, strict=True):
        assert times == pytest.approx(one.time_s - one.time_s[0], abs=1e-12)
    assert (placed.lengths(1000)[30:] == 1.0).all()


def test_samples_without_a_period_are_at_the_nearest_steps():
    placed = place_samples([grasp(REGULAR + 5 * JITTER)], DT)
    assert placed.lengths(1000) is None
    assert placed.starts[0].tolist() == np.rint((REGULAR + 5 * JITTER) / DT).tolist()


def moved(time: np.ndarray, *effects: EffectOn, factor: float = 1.0) -> np.ndarray:
    """Readings of positions, metres, ``(samples, 2)``."""
    replay = Replay(load_gripper("tiago"), [grasp(time)], step_factor=factor)
    base = {name: np.full(1, p.nominal) for name, p in replay.gripper.parameters.items()}
    base |= {"radius_m": np.full(1, 0.01), "offset_m": np.zeros(1)}
    motion = replay.simulate(np.array([0]), base, effects)
    return replay.read(motion, np.array([0]), np.ones(1)).position[0]


def test_readings_are_as_exact_as_those_of_even_samples():
    """A reading 1 ms beside its time stamp is 60 µm off where a finger moves at 60 mm a second."""
    even, uneven = (np.abs(moved(t) - moved(t, factor=0.25)).max() for t in (REGULAR, REGULAR + JITTER))
    assert uneven < 1.2 * even
    assert np.abs(moved(REGULAR + JITTER) - moved(REGULAR)).max() > 3 * even


def test_what_is_simulated_in_one_go_is_what_is_simulated_step_by_step():
    def acting(values) -> list[EffectOn]:
        return [EffectOn(get_effect("coulomb_friction"), "", np.array([values]), np.array([0]))]

    nothing = moved(REGULAR + JITTER, *acting([0.0]))  # it acts in every step, and does nothing
    assert nothing == pytest.approx(moved(REGULAR + JITTER), abs=1e-9)
    assert np.abs(nothing - moved(REGULAR + JITTER, *acting([0.05]))).max() > 1e-4
