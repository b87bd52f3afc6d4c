"""The policy's and the value's networks: sizes, symmetry, and where they start."""

from __future__ import annotations

from itertools import pairwise

import pytest
import torch
from scipy.stats import norm
from tensordict import TensorDict
from torchrl.envs.utils import ExplorationType, set_exploration_type

from forcegrasp.config import ObservationConfig, PPOConfig, TrainConfig
from forcegrasp.controllers.policy import make_policy, policy_of
from forcegrasp.errors import ConfigError
from forcegrasp.physics import default_gripper
from forcegrasp.train.algorithms.value_network import make_value


def act(policy, observation: torch.Tensor, mode=ExplorationType.RANDOM) -> TensorDict:
    with torch.no_grad(), set_exploration_type(mode):
        return policy(TensorDict({"observation": observation}, observation.shape[:-1]))


def swap(pairs: torch.Tensor) -> torch.Tensor:
    return pairs.unflatten(-1, (-1, 2)).flip(-1).flatten(-2)


def shaken(policy):
    with torch.no_grad():
        for parameter in policy.parameters():
            parameter += 0.3 * torch.randn_like(parameter)
    return policy


@pytest.fixture(autouse=True)
def seed():
    torch.manual_seed(0)


@pytest.mark.parametrize("mirrored", [True, False])
@pytest.mark.parametrize("hidden", [[7], [9, 5], [4, 4, 4]])
def test_sizes(hidden, mirrored):
    policy = make_policy([2] * 6, PPOConfig(hidden=hidden, mirrored=mirrored))
    matrices = [p for name, p in policy.named_parameters() if name.endswith("weight")]
    widths = [12, *hidden, 2]
    assert [tuple(m.shape) for m in matrices] == [(b, a) for a, b in pairwise(widths)]
    assert act(policy, torch.randn(3, 4, 12))["action"].shape == (3, 4, 2)


def test_one_finger_does_what_the_other_would(seed):
    policy = shaken(make_policy([2] * 15, PPOConfig(mirrored=True)))
    observation = torch.randn(64, 30)
    mean = act(policy, observation)["loc"]
    torch.testing.assert_close(act(policy, swap(observation))["loc"], mean.flip(-1))
    assert (mean[:, 0] - mean[:, 1]).abs().min() > 1e-5
    # a grasp that looks the same from both sides is answered the same
    same = torch.randn(64, 15).repeat_interleave(2, dim=-1)
    left, right = act(policy, same)["loc"].unbind(-1)
    torch.testing.assert_close(left, right)


def test_without_mirror_the_fingers_are_free():
    policy = shaken(make_policy([2] * 15, PPOConfig(mirrored=False)))
    observation = torch.randn(64, 30)
    assert (act(policy, swap(observation))["loc"] - act(policy, observation)["loc"].flip(-1)).abs().mean() > 0.01


@pytest.mark.parametrize("mirrored", [True, False])
def test_start(mirrored):
    policy = make_policy([2] * 15, PPOConfig(mirrored=mirrored, initial_action=-0.4, log_std=-1.2))
    drawn = act(policy, torch.randn(200, 30))
    assert (drawn["loc"] + 0.4).abs().max() < 0.1
    torch.testing.assert_close(drawn["scale"], torch.full((200, 2), -1.2).exp())


def test_probability_of_actions():
    policy = shaken(make_policy([2] * 15, PPOConfig(log_std=0.5)))
    drawn = act(policy, torch.randn(500, 30))
    expected = norm(drawn["loc"], drawn["scale"]).logpdf(drawn["action"]).sum(-1)
    torch.testing.assert_close(drawn["action_log_prob"].double(), torch.as_tensor(expected), rtol=1e-4, atol=1e-4)
    assert drawn["action"].abs().max() > 1, "actions are not squashed"
    assert ((drawn["action"] - drawn["loc"]) / drawn["scale"]).std() == pytest.approx(1, abs=0.1)


def test_deterministic_action_is_the_mean():
    drawn = act(make_policy([2] * 15, PPOConfig()), torch.randn(5, 30), ExplorationType.DETERMINISTIC)
    assert torch.equal(drawn["action"], drawn["loc"])


def grasping(frames: int) -> TrainConfig:
    return TrainConfig(observation=ObservationConfig(frames=frames), ppo=PPOConfig(squeeze_together=True))


@pytest.mark.parametrize("frames", [1, 3])
def test_fingers_squeeze_together_once_both_have_touched(frames):
    """had_contact is the last part, and the newest frame the last: the last two numbers."""
    policy = shaken(policy_of(grasping(frames), default_gripper()))
    observation = torch.randn(64, 10 * frames)
    plain = {}
    for touched in ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)):
        observation[:, -2:] = torch.tensor(touched)
        plain[touched] = act(policy, observation)["loc"]
        apart = (plain[touched][:, 0] - plain[touched][:, 1]).abs()
        assert (apart == 0).all() if all(touched) else apart.min() > 1e-5
    alone = policy[0].module[0].net(observation)
    torch.testing.assert_close(plain[1.0, 1.0], alone.mean(-1, keepdim=True).expand(-1, 2))


def test_fingers_that_squeeze_together_must_see_contact():
    config = grasping(3)
    config.observation.parts.remove("had_contact")
    with pytest.raises(ConfigError, match=r"ppo.squeeze_together: add had_contact to observation.parts"):
        policy_of(config, default_gripper())


@pytest.mark.parametrize(("critic", "inputs"), [("observation", 30), ("privileged", 40)])
def test_what_the_value_network_sees(critic, inputs):
    value = make_value(30, PPOConfig(critic=critic, hidden=[6]))
    matrices = [p for name, p in value.named_parameters() if name.endswith("weight")]
    assert [tuple(m.shape) for m in matrices] == [(6, inputs), (1, 6)]
    assert ("grasp_parameters" in value.in_keys) == (critic == "privileged")


def test_values_are_in_units_of_the_horizon():
    observation = torch.randn(9, 30)
    values = []
    for discount in (0.5, 0.99):
        torch.manual_seed(0)
        value = make_value(30, PPOConfig(critic="observation", discount=discount))
        with torch.no_grad():
            values.append(value(TensorDict({"observation": observation}, [9]))["state_value"])
    torch.testing.assert_close(values[1], 50 * values[0], rtol=1e-4, atol=1e-5)


def test_undiscounted_values_stay_finite():
    value = make_value(30, PPOConfig(critic="observation", discount=1.0))
    with torch.no_grad():
        assert value(TensorDict({"observation": torch.ones(1, 30)}, [1]))["state_value"].isfinite().all()
