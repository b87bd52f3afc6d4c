"""The environment without transforms: what it tells, pays, draws and when it ends."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from tensordict import TensorDict
from torchrl.data import Bounded
from torchrl.envs.utils import check_env_specs

from forcegrasp.config import GraspConfig, PhysicsConfig, RewardConfig
from forcegrasp.effects import get_effect
from forcegrasp.env import GraspEnv
from forcegrasp.env.grasp_env import OBSERVATIONS
from forcegrasp.errors import ConfigError
from forcegrasp.models.model_file import Fitted, FoundEffect, Model
from forcegrasp.physics import FixedGrasps, GraspSimulator
from forcegrasp.physics.gripper_file import load_gripper

FAST = PhysicsConfig(tier="fast", threads=1)
#: Large objects, which both fingers meet within 20 steps.
NEAR = GraspConfig(radius_m=[0.03, 0.035])


def play(env: GraspEnv, actions: torch.Tensor, start: TensorDict | None = None) -> TensorDict:
    """Plays given actions ``(T, n, 2)``; batch ``(n, T)``."""
    state, steps = env.reset() if start is None else start, []
    for action in actions:
        stepped, state = env.step_and_maybe_reset(state.set("joint_delta", action))
        steps.append(stepped)
    return torch.stack(steps, 1)


def close(steps: int, n: int, seed: int = 0) -> torch.Tensor:
    """Deltas that close, each finger at its own speed, ``(steps, n, 2)``."""
    generator = torch.Generator().manual_seed(seed)
    return -0.003 * (0.4 + 0.6 * torch.rand(1, n, 2, generator=generator)).expand(steps, n, 2)


@pytest.mark.parametrize("n", [1, 3])
def test_specs(n):
    check_env_specs(GraspEnv(n, FAST, GraspConfig(steps=20)), seed=0)


def test_entries_and_their_shapes():
    env = GraspEnv(3, FAST)
    sizes = {
        "joint_position": 2,
        "measured_position": 2,
        "commanded_position": 2,
        "force": 2,
        "measured_force": 2,
        "goal_force": 1,
        "object_position": 1,
        "object_speed": 1,
        "grasp_parameters": 5,
        ("reward_terms", "force_paper"): 1,
        ("reward_terms", "force_normalised"): 1,
        ("reward_terms", "object"): 1,
        ("reward_terms", "overshoot"): 1,
    }
    named = {"motors": 2, "channels": 2}
    assert {key: named.get(size, size) for key, (size, _) in OBSERVATIONS.items()} == sizes
    assert {*env.observation_spec.keys(True, True)} == {*sizes}
    state = env.reset()
    stepped = env.step(state.clone().set("joint_delta", torch.zeros(3, 2))).get("next")
    for td in (state, stepped):
        assert {key: (*td.get(key).shape,) for key in sizes} == {key: (3, size) for key, size in sizes.items()}
        assert all(td.get(key).dtype == torch.float32 for key in sizes)
    assert {*stepped.keys()} == {*state.keys(), "reward"}
    assert env.action_keys == ["joint_delta"]
    delta = env.full_action_spec["joint_delta"]
    assert isinstance(delta, Bounded)
    assert delta.shape == (3, 2)
    assert delta.space.high.max() == -delta.space.low.min() == pytest.approx(0.045)


def test_state_is_the_simulators(draw):
    grasps, actions = draw(4, radius_m=[0.03, 0.035]), close(30, 4)
    rollout = play(GraspEnv(4, FAST, sampler=FixedGrasps(grasps)), actions).get("next")
    simulator = GraspSimulator(4, "fast", threads=1)
    simulator.reset(grasps)
    for t, action in enumerate(actions):
        simulator.step(action.double().numpy())
        now = rollout[:, t]
        for key in ("joint_position", "measured_position", "commanded_position", "force", "measured_force"):
            np.testing.assert_array_equal(now.get(key), getattr(simulator, key).astype(np.float32))
        for key in ("object_position", "object_speed"):
            np.testing.assert_array_equal(now.get(key)[:, 0], getattr(simulator, key).astype(np.float32))
        np.testing.assert_array_equal(now.get("goal_force")[:, 0], grasps.goal_force_n.astype(np.float32))
        np.testing.assert_array_equal(now.get("grasp_parameters"), grasps.as_array().astype(np.float32))


NOMINAL = {"position_gain": Fitted(100.0, 100.0, 100.0), "velocity_gain": Fitted(-9.0, -9.0, -9.0)}


def model_with(name: str, *values: float, low: float = 1.0, high: float = 1.0) -> Model:
    """A nominal gripper with one effect, known but for these factors."""
    kind = get_effect(name)
    numbers = {p.name: Fitted(v, *sorted((low * v, high * v))) for p, v in zip(kind.parameters, values, strict=True)}
    return Model(load_gripper("tiago"), NOMINAL, effects=(FoundEffect(kind, kind.variants[0], numbers),))


def test_without_a_model_what_is_measured_is_true():
    rollout = play(GraspEnv(3, FAST, NEAR), close(25, 3))
    assert (rollout.get(("next", "force")) > 0).any()
    for state in (rollout, rollout.get("next")):
        assert torch.equal(state.get("measured_position"), state.get("joint_position"))
        assert torch.equal(state.get("measured_force"), state.get("force"))


def test_force_bias_of_a_model_is_measured_and_not_paid_for(draw):
    """Readings are off by exactly the bias; what happens and what is paid stay as they are."""
    grasps, actions = draw(4, radius_m=[0.03, 0.035], b2=[-9.0, -9.0]), close(25, 4)
    model = model_with("force_bias", 0.05, -0.03)
    plain = play(GraspEnv(4, FAST, sampler=FixedGrasps(grasps)), actions).get("next")
    biased = play(GraspEnv(4, FAST, sampler=FixedGrasps(grasps), model=model), actions).get("next")
    for key in plain.keys(True, True):
        if key != "measured_force":
            assert torch.equal(biased.get(key), plain.get(key)), key
    off = biased.get("measured_force") - biased.get("force")
    torch.testing.assert_close(off, torch.tensor([0.05, -0.03]).expand_as(off), rtol=0, atol=1e-7)


def test_encoder_bias_of_a_model_is_measured():
    """The gripper's own numbers are used: a command is a delta to what the encoder says."""
    env = GraspEnv(2, FAST, NEAR, model=model_with("encoder_bias", -0.001, 0.0005))
    state = env.reset()
    off = torch.tensor([-0.001, 0.0005]).expand(2, 2)
    torch.testing.assert_close(state.get("measured_position") - state.get("joint_position"), off, rtol=0, atol=1e-8)
    after = env.step(state.clone().set("joint_delta", torch.full((2, 2), -0.002))).get("next")
    commanded = (state.get("measured_position") - 0.002).clamp(max=0.045)
    torch.testing.assert_close(after.get("commanded_position"), commanded, rtol=0, atol=1e-8)


def test_models_are_drawn_from_the_seed():
    model = model_with("force_bias", 0.05, -0.03, low=0.5)

    def bias(seed: int) -> torch.Tensor:
        env = GraspEnv(4, FAST, NEAR, seed=seed, model=model)
        return torch.stack([env.reset().get("measured_force") for _ in range(2)])

    one, again, other = bias(1), bias(1), bias(2)
    assert torch.equal(one, again)
    assert not (one == other).any()
    assert not (one[0] == one[1]).any()
    assert one.abs().max() <= 0.05


def test_velocity_gain_of_a_model_replaces_b2():
    state = GraspEnv(3, FAST, GraspConfig(b2=[-7.0, -6.0]), model=model_with("force_bias", 0.0, 0.0)).reset()
    assert torch.equal(state.get("grasp_parameters")[:, 1], torch.full((3,), -9.0))


def test_partial_reset_with_a_model():
    env = GraspEnv(3, FAST, NEAR, model=model_with("force_bias", 0.05, -0.03, low=0.5))
    state = play(env, close(20, 3)).get("next")[:, -1].exclude("reward")
    reset = env.reset(state.clone().set("_reset", torch.tensor([[False], [True], [False]])))
    others = torch.tensor([0, 2])
    for key in OBSERVATIONS:
        assert torch.equal(reset.get(key)[others], state.get(key)[others]), key
    assert not torch.equal(reset.get("measured_force")[1], state.get("measured_force")[1] - state.get("force")[1])


def test_specs_with_a_model():
    check_env_specs(GraspEnv(2, FAST, GraspConfig(steps=20), model=model_with("command_delay", 0.05, low=0.2)), seed=0)


@pytest.mark.parametrize("form", ["paper", "goal_normalised"])
@pytest.mark.parametrize(("force_weight", "object_weight", "threshold"), [(1.0, 1.0, 5e-5), (0.3, 2.5, 1.5e-4)])
def test_reward_is_the_papers(form, force_weight, object_weight, threshold):
    config = RewardConfig(
        form=form, force_weight=force_weight, object_weight=object_weight, speed_threshold_m=threshold
    )
    rollout = play(GraspEnv(16, FAST, NEAR, config), close(30, 16))
    after = rollout.get("next")
    force, goal, speed = (after.get(key).double().numpy() for key in ("force", "goal_force", "object_speed"))
    total = np.abs(goal - force).sum(axis=-1, keepdims=True)
    paper, normalised = 1 - np.tanh(total), 1 - np.tanh(total / goal)
    penalty = np.where(speed > threshold, -1.0, 0.0)
    assert 0.02 < (penalty < 0).mean() < 0.98
    terms = after.get("reward_terms")
    np.testing.assert_allclose(terms.get("force_paper"), paper, atol=1e-6)
    np.testing.assert_allclose(terms.get("force_normalised"), normalised, atol=1e-6)
    np.testing.assert_array_equal(terms.get("object"), penalty)
    expected = force_weight * (paper if form == "paper" else normalised) + object_weight * penalty
    np.testing.assert_allclose(after.get("reward"), expected, atol=4e-6)


def test_force_beyond_the_goal_costs_its_weight():
    """Without a weight not a bit of the reward differs, whatever the margin is."""
    weights = ((0.0, 0.05), (0.0, 0.5), (0.7, 0.2))
    plain, other, gentle = (
        play(GraspEnv(16, FAST, NEAR, RewardConfig(overshoot_weight=weight, overshoot_margin=margin)), close(30, 16))[
            "next"
        ]
        for weight, margin in weights
    )
    assert torch.equal(plain["reward"], other["reward"])
    beyond = (plain["force"] / plain["goal_force"] - 1.2).clamp_min(0).sum(-1, keepdim=True)
    assert 0.02 < (beyond > 0).float().mean() < 0.98
    torch.testing.assert_close(gentle["reward_terms", "overshoot"], -beyond)
    torch.testing.assert_close(gentle["reward"], plain["reward"] - 0.7 * beyond)


def test_action_weight_is_left_to_its_transform():
    rewards = [
        play(GraspEnv(2, FAST, NEAR, RewardConfig(action_weight=weight)), close(10, 2)).get(("next", "reward"))
        for weight in (0.0, 5.0)
    ]
    assert torch.equal(*rewards)


def test_the_callers_reward_config_is_copied():
    config = RewardConfig()
    GraspEnv(1, FAST, reward=config).reward_config.object_weight = 7
    assert config.object_weight == 1


def test_episode_is_truncated_at_its_length_and_never_terminated():
    env = GraspEnv(2, FAST, GraspConfig(steps=7))
    rollout = env.rollout(20, break_when_any_done=True)
    assert rollout.batch_size == (2, 7)
    after = rollout.get("next")
    expected = torch.arange(7).expand(2, 7).unsqueeze(-1) == 6
    assert torch.equal(after.get("truncated"), expected)
    assert torch.equal(after.get("done"), expected)
    assert not after.get("terminated").any()
    assert not rollout.get("done").any()


def test_episodes_follow_each_other():
    env = GraspEnv(2, FAST, GraspConfig(steps=5))
    rollout = env.rollout(13, break_when_any_done=False)
    ended = rollout.get(("next", "truncated"))[0, :, 0].nonzero().squeeze(1)
    assert ended.tolist() == [4, 9]
    kappa = rollout.get("grasp_parameters")[0, :, 0]
    assert len(kappa.unique()) == 3  # a new grasp each time
    assert torch.equal(rollout.get("joint_position")[:, [0, 5, 10]], torch.full((2, 3, 2), 0.045))


def test_partial_reset():
    actions = close(20, 3)
    env = GraspEnv(3, FAST, GraspConfig(steps=30, radius_m=[0.03, 0.035]))
    undisturbed = play(env, torch.cat([actions, actions[:10]]))
    env.set_seed(0)
    state = play(env, actions).get("next")[:, -1].exclude("reward")
    mask = torch.tensor([[False], [True], [False]])
    reset = env.reset(state.clone().set("_reset", mask))

    others = torch.tensor([0, 2])
    for key in (*OBSERVATIONS, "done", "truncated"):
        assert torch.equal(reset.get(key)[others], state.get(key)[others]), key
    assert (reset.get("grasp_parameters")[1] != state.get("grasp_parameters")[1]).all()
    assert torch.equal(reset.get("joint_position")[1], torch.tensor([0.045, 0.045]))
    assert not reset.get("force")[1].any()

    resumed = play(env, actions[:10], reset)
    for key in (*OBSERVATIONS, "truncated", "reward"):
        assert torch.equal(resumed.get("next").get(key)[others], undisturbed.get("next").get(key)[others, 20:]), key
    assert resumed.get(("next", "truncated"))[:, -1, 0].tolist() == [True, False, True]  # each slot has its own age


def test_seed_determines_the_grasps():
    env = GraspEnv(4, FAST, seed=1)
    first = env.reset().get("grasp_parameters")
    assert not torch.equal(first, env.reset().get("grasp_parameters"))
    env.set_seed(1)
    assert torch.equal(first, env.reset().get("grasp_parameters"))
    assert torch.equal(first, GraspEnv(4, FAST, seed=1).reset().get("grasp_parameters"))
    assert not torch.equal(first, GraspEnv(4, FAST, seed=2).reset().get("grasp_parameters"))


@pytest.mark.parametrize("tier", ["reference", "fast"])
def test_a_batch_is_its_grasps_one_by_one(draw, tier):
    physics, grasps, actions = PhysicsConfig(tier, 1), draw(5, radius_m=[0.03, 0.035]), close(25, 5)
    together = play(GraspEnv(5, physics, sampler=FixedGrasps(grasps)), actions)
    assert (together.get(("next", "force")) > 0).any()
    for i in range(5):
        alone = play(GraspEnv(1, physics, sampler=FixedGrasps(grasps[i])), actions[:, i : i + 1])
        for key in ("joint_position", "commanded_position", "force", "object_position", "object_speed", "truncated"):
            assert torch.equal(alone.get(("next", key))[0], together.get(("next", key))[i]), key
        # tanh rounds differently in vectors of different length
        torch.testing.assert_close(alone.get(("next", "reward"))[0], together.get(("next", "reward"))[i])


def test_ranges_of_the_config_are_drawn_from():
    state = GraspEnv(200, FAST, GraspConfig(kappa=[0.4, 0.5], b2=[-8, -7])).reset().get("grasp_parameters")
    assert 0.4 <= state[:, 0].min() < state[:, 0].max() <= 0.5
    assert -8 <= state[:, 1].min() < state[:, 1].max() <= -7


@pytest.mark.parametrize(
    "parts",
    [
        {"physics": PhysicsConfig(tier="quick")},
        {"grasp": GraspConfig(kappa=[0.0, 2.0])},
        {"grasp": GraspConfig(deformation_m=0.02)},
        {"reward": RewardConfig(form="mine")},
    ],
    ids=["tier", "kappa", "deformation", "form"],
)
def test_options_out_of_range_are_refused(parts):
    with pytest.raises(ConfigError):
        GraspEnv(1, **parts)
