"""The reward's terms against the paper's equations, written again in float64."""

from __future__ import annotations

import math

import pytest
import torch

from forcegrasp.env.reward import force_reward, normalised_force_reward, object_penalty, overshoot_penalty


def test_force_reward():
    error = torch.randn(50, 2, generator=torch.Generator().manual_seed(0))
    expected = [1 - math.tanh(abs(left) + abs(right)) for left, right in error.tolist()]  # eq. 7
    torch.testing.assert_close(force_reward(error), torch.tensor(expected).unsqueeze(1), rtol=0, atol=1e-6)


def test_force_reward_is_one_at_the_goal_only():
    error = torch.tensor([[0.0, 0.0], [0.1, -0.1], [10.0, 10.0]])
    reward = force_reward(error).squeeze(1).tolist()
    assert reward[0] == 1
    assert 0 < reward[1] < 1
    assert reward[2] == pytest.approx(0, abs=1e-6)


def test_normalised_force_reward():
    generator = torch.Generator().manual_seed(1)
    error, goal = torch.randn(50, 2, generator=generator), torch.rand(50, 1, generator=generator) + 0.08
    expected = [
        1 - math.tanh((abs(left) + abs(right)) / f)
        for (left, right), (f,) in zip(error.tolist(), goal.tolist(), strict=True)
    ]
    torch.testing.assert_close(
        normalised_force_reward(error, goal), torch.tensor(expected).unsqueeze(1), rtol=0, atol=1e-6
    )


@pytest.mark.parametrize("margin", [0.0, 0.05, 0.5])
def test_overshoot_penalty(margin):
    generator = torch.Generator().manual_seed(2)
    goal = torch.rand(50, 1, generator=generator) + 0.08
    force = goal * 2 * torch.rand(50, 2, generator=generator)
    expected = [
        -sum(max(0.0, f / g - 1 - margin) for f in pair)
        for pair, (g,) in zip(force.tolist(), goal.tolist(), strict=True)
    ]
    found = overshoot_penalty(force, goal, margin)
    torch.testing.assert_close(found, torch.tensor(expected).unsqueeze(1), rtol=0, atol=1e-5)
    assert (found < 0).any()
    assert (found == 0).any()


def test_overshoot_penalty_costs_nothing_up_to_the_margin_and_no_undershoot():
    force = torch.tensor([[0.0, 0.0], [1.0, 1.0], [1.25, 0.5], [1.5, 1.25], [3.0, 1.25]])
    assert overshoot_penalty(force, torch.ones(5, 1), 0.25).tolist() == [[0], [0], [0], [-0.25], [-1.75]]


def test_object_penalty_is_strict():
    speed = torch.tensor([[0.0], [5e-5], [5.1e-5], [1.0]])
    threshold = speed[1].item()
    assert object_penalty(speed, threshold).tolist() == [[0], [0], [-1], [-1]]  # eq. 8
    assert object_penalty(speed.unsqueeze(0), 2e-4).tolist() == [[[0], [0], [0], [-1]]]
