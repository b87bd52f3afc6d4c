"""TouchForce: p(t) = max(p(t−1), f of fingers with contact), p(0) = 0."""

from __future__ import annotations

import numpy as np
import torch
from tensordict import TensorDictBase
from torchrl.envs import TransformedEnv
from torchrl.envs.transforms import Compose

from forcegrasp.transforms import HadContact, TouchForce


def simulate(fake_grasp, play, forces: list, steps: int = 100) -> TensorDictBase:
    """Steps of one grasp whose force readings at each age are ``forces``."""
    transforms = Compose(HadContact(0.05, in_key="force"), TouchForce(force_key="force"))
    base = fake_grasp((1,), steps=steps, forces=torch.tensor(forces)[:, None])
    return play(TransformedEnv(base, transforms), torch.zeros(len(forces) - 1, 1, 2))[0]


def touch(rollout: TensorDictBase) -> list[float]:
    """p at the first step and after each."""
    return torch.cat([rollout["touch_force"][:1], rollout["next", "touch_force"]]).flatten().tolist()


def test_is_the_largest_force_of_fingers_that_have_touched(fake_grasp, play) -> None:
    forces = [[0.0, 0.0], [0.04, -0.3], [0.25, 0.05], [0.2, 0.05], [0.1, 0.75], [0.1, 0.1]]
    assert touch(simulate(fake_grasp, play, forces)) == [0.0, 0.0, 0.25, 0.25, 0.75, 0.75]


def test_is_zero_before_a_touch_however_forces_are_below_zero(fake_grasp, play) -> None:
    found = touch(simulate(fake_grasp, play, [[-1.0, -0.5]] * 3))
    assert found == [0, 0, 0]
    assert not np.signbit(found).any()  # a goal divided by it is to be + ∞


def test_each_episode_starts_anew(fake_grasp, play) -> None:
    # a grasp ends after 2 to 4 steps; contact is at age 1 only
    rollout = simulate(fake_grasp, play, [[0.0, 0.0], [1.0, 0.0], *[[0.0, 0.0]] * 10], steps=2)
    starts = torch.cat([torch.ones(1, 1, dtype=torch.bool), rollout["next", "done"][:-1]])
    assert starts.sum() > 2
    assert torch.equal(rollout["touch_force"], (~starts).float())
