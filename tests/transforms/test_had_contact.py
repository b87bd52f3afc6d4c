"""HadContact: c(t) = f(t) > f_θ, h(t) = c(t) ∨ h(t−1), h(0) = 0."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from tensordict import TensorDict
from torchrl.envs import TransformedEnv

from forcegrasp.transforms import HadContact

STEPS, ROWS = 8, 3
# exact in float32, so that "exactly at the threshold" is the same number here and there
THRESHOLDS = [0.0, 1 / 64, 0.0625, 0.5]
FORCES = arrays(
    np.float32,
    (STEPS + 1, ROWS, 2),
    elements=st.one_of(st.sampled_from(THRESHOLDS), st.floats(-1, 6, width=32)),
)


def flags(forces: np.ndarray, threshold: float) -> np.ndarray:
    h = np.zeros(forces.shape)
    for t in range(1, len(forces)):
        for row, finger in np.ndindex(forces.shape[1:]):
            touches = float(forces[t, row, finger]) > threshold
            h[t, row, finger] = 1.0 if touches or h[t - 1, row, finger] == 1.0 else 0.0
    return h


def simulate(fake_grasp, play, forces: np.ndarray, threshold: float) -> np.ndarray:
    base = fake_grasp((ROWS,), steps=100, forces=torch.from_numpy(forces))
    env = TransformedEnv(base, HadContact(threshold, in_key="force"))
    rollout = play(env, torch.zeros(len(forces) - 1, ROWS, 2))
    h = torch.cat([rollout["had_contact"][:, :1], rollout["next", "had_contact"]], 1)
    return h.transpose(0, 1).numpy()


@settings(max_examples=40, deadline=None)
@given(forces=FORCES, threshold=st.sampled_from(THRESHOLDS))
def test_equals_the_equation(fake_grasp, play, forces: np.ndarray, threshold: float) -> None:
    np.testing.assert_array_equal(simulate(fake_grasp, play, forces, threshold), flags(forces, threshold))


@pytest.mark.parametrize("threshold", [0.05, 0.0625])
def test_exactly_at_the_threshold_is_no_contact(fake_grasp, play, threshold: float) -> None:
    at = np.float32(threshold)
    forces = np.full((3, ROWS, 2), at)
    forces[2, 1, 0] = np.nextafter(at, np.float32(1))
    want = np.zeros((3, ROWS, 2))
    want[2, 1, 0] = 1
    np.testing.assert_array_equal(simulate(fake_grasp, play, forces, threshold), want)


def test_stays_one_when_contact_is_lost_and_fingers_do_not_mix(fake_grasp, play) -> None:
    forces = np.zeros((5, ROWS, 2), np.float32)
    forces[2, 0, 1] = 1.0
    want = np.zeros_like(forces)
    want[2:, 0, 1] = 1.0
    np.testing.assert_array_equal(simulate(fake_grasp, play, forces, 0.05), want)


def test_starts_at_zero_even_in_contact(fake_grasp, play) -> None:
    forces = np.full((2, ROWS, 2), 3.0, np.float32)
    np.testing.assert_array_equal(simulate(fake_grasp, play, forces, 0.05)[:, 0, 0], [0.0, 1.0])


def test_pull_is_no_contact(fake_grasp, play) -> None:
    forces = np.full((2, ROWS, 2), -3.0, np.float32)
    assert not simulate(fake_grasp, play, forces, 0.05).any()


def test_each_episode_starts_anew(fake_grasp, play) -> None:
    # rows end after 2 to 4 steps; contact is at age 1 only
    forces = torch.zeros(6, ROWS, 2)
    forces[1] = 1.0
    env = TransformedEnv(fake_grasp((ROWS,), steps=2, forces=forces), HadContact(0.05, in_key="force"))
    rollout = play(env, torch.zeros(12, ROWS, 2))
    assert rollout["next", "had_contact"].all()
    starts = torch.cat([torch.ones(ROWS, 1, 1, dtype=torch.bool), rollout["next", "done"][:, :-1]], 1)
    assert starts.sum() > 2 * ROWS
    np.testing.assert_array_equal(rollout["had_contact"].numpy(), (~starts).expand(-1, -1, 2).numpy())


def test_a_motor_that_moves_has_no_contact() -> None:
    """Where its effort is read: force counts only in steps in which it stood nearly still."""
    moves, forces = [0.02, 0.0009, 0.0011, 0.0], [1.0, 0.01, 1.0, 1.0]
    transform, position = HadContact(0.05, stall=0.001), 0.5
    frame = TensorDict({"sensed_force": torch.zeros(1, 1), "sensed_position": torch.full((1, 1), position)}, [1])
    frame, seen = transform._reset(frame, frame), []
    for move, force in zip(moves, forces, strict=True):
        position -= move
        values = {"sensed_force": torch.full((1, 1), force), "sensed_position": torch.full((1, 1), position)}
        frame = transform._step(frame, TensorDict(values, [1]))
        seen.append(bool(frame["had_contact"]))
    assert seen == [False, False, False, True]
