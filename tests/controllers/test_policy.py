"""The learned policy's network: sizes, start, and its mirror symmetry."""

from __future__ import annotations

import math

import pytest
import torch
from tensordict import TensorDict
from torchrl.envs.utils import ExplorationType, set_exploration_type

from forcegrasp.config import PPOConfig
from forcegrasp.controllers.policy import make_policy


@pytest.fixture(autouse=True)
def seed():
    torch.manual_seed(0)


def observe(n: int = 500, size: int = 30) -> TensorDict:
    return TensorDict({"observation": torch.randn(n, size)}, batch_size=n)


def swap(pairs: torch.Tensor) -> torch.Tensor:
    """Left for right in every pair."""
    return pairs.unflatten(-1, (-1, 2)).flip(-1).flatten(-2)


def trained(config: PPOConfig, size: int = 30):
    """A policy whose last layer is not near zero any more."""
    policy = make_policy([2] * (size // 2), config)
    with torch.no_grad():
        for parameter in policy.parameters():
            parameter.add_(0.3 * torch.randn_like(parameter))
    return policy


@pytest.mark.parametrize("mirrored", [True, False])
def test_starts_at_the_initial_action_and_deviation(mirrored):
    config = PPOConfig(initial_action=-0.4, log_std=-0.7, mirrored=mirrored)
    with set_exploration_type(ExplorationType.RANDOM):
        td = make_policy([2] * 15, config)(observe(5000))
    assert td["loc"].shape == td["scale"].shape == td["action"].shape == (5000, 2)
    assert td["action_log_prob"].shape == (5000,)
    torch.testing.assert_close(td["loc"], torch.full_like(td["loc"], -0.4), rtol=0, atol=0.1)
    torch.testing.assert_close(td["scale"], torch.full_like(td["scale"], math.exp(-0.7)))
    noise = (td["action"] - td["loc"]).double()
    assert noise.std().item() == pytest.approx(math.exp(-0.7), rel=0.05)


def test_log_probability_is_the_gaussians():
    with set_exploration_type(ExplorationType.RANDOM):
        td = trained(PPOConfig())(observe())
    z = (td["action"] - td["loc"]) / td["scale"]
    expected = (-0.5 * z**2 - td["scale"].log() - 0.5 * math.log(2 * math.pi)).sum(-1)
    torch.testing.assert_close(td["action_log_prob"], expected, rtol=1e-4, atol=1e-4)


def test_mirrored_policy_swaps_its_actions_with_the_sides():
    policy, td = trained(PPOConfig(mirrored=True)), observe()
    swapped = TensorDict({"observation": swap(td["observation"])}, batch_size=td.batch_size)
    loc = policy(td)["loc"]
    torch.testing.assert_close(policy(swapped)["loc"], loc.flip(-1), rtol=1e-5, atol=1e-5)
    assert (loc[:, 0] - loc[:, 1]).abs().mean() > 0.01


def test_plain_policy_need_not():
    policy, td = trained(PPOConfig(mirrored=False)), observe()
    swapped = TensorDict({"observation": swap(td["observation"])}, batch_size=td.batch_size)
    loc = policy(td)["loc"]
    assert (policy(swapped)["loc"] - loc.flip(-1)).abs().max() > 0.1


@pytest.mark.parametrize("mirrored", [True, False])
def test_layers(mirrored):
    policy = make_policy([2] * 6, PPOConfig(hidden=[7, 5], mirrored=mirrored))
    shapes = [(*parameter.shape,) for parameter in policy.parameters() if parameter.ndim == 2]
    assert shapes == [(7, 12), (5, 7), (2, 5)]
    activations = [module for module in policy.modules() if isinstance(module, torch.nn.Tanh)]
    assert len(activations) == 2


def test_deterministic_action_is_the_mean():
    policy, td = trained(PPOConfig()), observe()
    with set_exploration_type(ExplorationType.DETERMINISTIC):
        policy(td)
    assert torch.equal(td["action"], td["loc"])
