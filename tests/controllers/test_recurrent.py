"""The policy with a memory: symmetric if it is mirrored, one step at a time as in a sequence."""

from __future__ import annotations

import pytest
import torch
from tensordict import TensorDict
from torchrl.modules import set_recurrent_mode

from forcegrasp.config import PPOConfig
from forcegrasp.controllers.recurrent import RecurrentNetwork, make_recurrent_policy
from forcegrasp.physics import default_gripper

SIZES = [2, 1, 2]
SWAPPED = [1, 0, 2, 4, 3]


def make(mirrored: bool):
    torch.manual_seed(0)
    config = PPOConfig(hidden=[8], memory=5, mirrored=mirrored)
    policy = make_recurrent_policy(SIZES, config, default_gripper(), contact=[3, 4])
    with torch.no_grad():
        for parameter in policy.parameters():
            parameter.normal_(0.0, 0.5)
    return policy


def act(policy, observations: torch.Tensor) -> torch.Tensor:
    """Mean actions over episodes ``(n, T, size)``."""
    is_init = torch.zeros(*observations.shape[:2], 1, dtype=torch.bool)
    is_init[:, 0] = True
    with torch.no_grad(), set_recurrent_mode(True):
        return policy[0](TensorDict({"observation": observations, "is_init": is_init}, is_init.shape[:2]))["loc"]


@pytest.mark.parametrize("mirrored", [True, False])
def test_the_mirror_image_of_an_episode_is_answered_by_that_of_the_actions(mirrored):
    policy, observations = make(mirrored), torch.randn(20, 6, 5)
    own, swapped = act(policy, observations), act(policy, observations[..., SWAPPED]).flip(-1)
    assert torch.allclose(own, swapped, atol=1e-6) == mirrored


@pytest.mark.parametrize("mirrored", [True, False])
def test_one_step_at_a_time_is_the_sequence(mirrored):
    policy, observations = make(mirrored), torch.randn(1, 6, 5)
    network = RecurrentNetwork(policy)
    memory, actions = torch.zeros(1, network.size), []
    for observation in observations[0].split(1):
        action, memory = network(observation, memory)
        actions.append(action)
    torch.testing.assert_close(torch.stack(actions, 1), act(policy, observations))


def test_motors_squeeze_together_once_all_have_touched():
    observations = torch.randn(4, 6, 5)
    touched = (observations[..., 3:] > 0.5).all(-1)
    left, right = act(make(True), observations).unbind(-1)
    assert torch.equal(left == right, touched)
    assert touched.any()
