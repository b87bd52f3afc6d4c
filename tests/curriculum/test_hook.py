"""The curriculum really reaches the environment."""

from __future__ import annotations

import pytest
import torch

from forcegrasp.config import ActionConfig, CurriculumConfig, GraspConfig, PhysicsConfig, RewardConfig
from forcegrasp.curriculum import CurriculumHook, LinearSchedule
from forcegrasp.env import GraspEnv, build_env

FAST = PhysicsConfig("fast", 1)
FRAMES = 900


def hook_of(env, **options) -> CurriculumHook:
    grasp, reward = GraspConfig(), RewardConfig()
    return CurriculumHook(LinearSchedule(CurriculumConfig(**options), grasp, reward, FRAMES), env)


@pytest.mark.parametrize("make", [GraspEnv, build_env])
def test_ranges_hold_from_the_next_reset_on(make):
    env = make(500, physics=FAST)
    hook = hook_of(env)

    def drawn():
        parameters = env.reset()["grasp_parameters"].double()
        return parameters[:, 2], parameters[:, 3]

    radius, offset = drawn()
    assert radius.max() > 0.03
    hook.apply(0)
    radius, offset = drawn()
    assert 0.020 <= radius.min() < 0.0205 < 0.0245 < radius.max() <= 0.0250001
    assert not offset.any()
    hook.apply(FRAMES // 6)
    radius, offset = drawn()
    assert 0.01749 <= radius.min() < 0.018 < 0.0295 < radius.max() <= 0.0300001
    assert offset.abs().max() > 0.01
    hook.apply(FRAMES)
    radius, offset = drawn()
    assert 0.01499 <= radius.min() < 0.016 < 0.034 < radius.max() <= 0.0350001


@pytest.mark.parametrize("make", [GraspEnv, build_env])
def test_offsets_lie_on_the_side_that_was_asked_for(make):
    """The paper's range is symmetric, and hides a mirrored one."""
    env = make(500, physics=FAST)
    curriculum = CurriculumConfig(offset_m=[0.002, 0.004], end_fraction=0.5)
    schedule = LinearSchedule(curriculum, GraspConfig(offset_m=[-0.003, 0.009]), RewardConfig(), FRAMES)
    hook = CurriculumHook(schedule, env)
    for frames, low, high in ((0, 0.002, 0.004), (FRAMES // 4, -0.0005, 0.0065), (FRAMES, -0.003, 0.009)):
        assert hook.apply(frames).offset_m == pytest.approx((low, high))
        offset = env.reset()["grasp_parameters"][:, 3]
        margin = 0.05 * (high - low)
        assert low - 1e-7 <= offset.min() < low + margin
        assert high - margin < offset.max() <= high + 1e-7


def test_grasp_in_hand_is_left_alone():
    env = build_env(20, physics=FAST)
    before = env.reset()
    hook_of(env).apply(0)
    after = env.step(before.clone().set("action", torch.zeros(20, 2)))["next"]
    assert torch.equal(after["grasp_parameters"], before["grasp_parameters"])


def test_reward_follows_the_schedule():
    # without the bias, that a finger may push the object at full speed
    env = build_env(16, physics=FAST, action=ActionConfig(inductive_bias=False))
    hook = hook_of(env)

    def push(frames: int):
        values = hook.apply(frames)
        env.base_env.sampler.set_ranges([0.03, 0.035], [-0.006, 0.006])  # the same grasps each time
        env.base_env.set_seed(0)
        state, steps = env.reset(), []
        for _ in range(40):
            action = torch.tensor([[-1.0, 0.0]]).expand(16, 2)
            stepped, state = env.step_and_maybe_reset(state.set("action", action))
            steps.append(stepped["next"])
        return values, torch.stack(steps, 1)

    fast_steps = []
    for frames, weight, threshold in ((0, 0.0, 2e-4), (150, 0.5, 1.25e-4), (300, 1.0, 5e-5)):
        values, after = push(frames)
        assert values.object_weight == pytest.approx(weight)
        penalty = -(after["object_speed"] > threshold).float()
        terms = after["reward_terms"]
        assert torch.equal(terms["object"], penalty)
        expected = terms["force_paper"] + weight * penalty + 0.2 * terms["action"]
        torch.testing.assert_close(after["reward"], expected)
        fast_steps.append(-penalty.sum().item())
    assert fast_steps[0] < fast_steps[1] < fast_steps[2]


def test_the_weight_of_the_overshoot_reaches_the_reward():
    env = build_env(16, physics=FAST, action=ActionConfig(inductive_bias=False))
    schedule = LinearSchedule(CurriculumConfig(), GraspConfig(), RewardConfig(overshoot_weight=2.0), FRAMES)
    hook, rewards = CurriculumHook(schedule, env), []
    for frames, weight in ((0, 0.0), (150, 1.0), (300, 2.0)):
        assert hook.apply(frames).overshoot_weight == pytest.approx(weight)
        env.base_env.sampler.set_ranges([0.03, 0.035], [-0.006, 0.006])  # the same grasps each time
        env.base_env.reward_config.object_weight = 0.0
        env.base_env.set_seed(0)
        after = env.rollout(40, lambda td: td.set("action", -torch.ones(16, 2)))["next"]
        rewards.append(after["reward"] - weight * after["reward_terms", "overshoot"])
        assert after["reward_terms", "overshoot"].any()
    for others in rewards[1:]:
        torch.testing.assert_close(others, rewards[0], rtol=0, atol=1e-4)


def test_disabled_curriculum_leaves_the_environment_at_its_final_values():
    env = build_env(500, physics=FAST)
    values = hook_of(env, enabled=False).apply(0)
    assert (values.object_weight, values.speed_threshold_m) == (1.0, 5e-5)
    radius = env.reset()["grasp_parameters"][:, 2]
    assert radius.min() < 0.016
    assert radius.max() > 0.034


def test_the_callers_configs_are_left_alone():
    grasp, reward = GraspConfig(), RewardConfig()
    env = build_env(1, physics=FAST, grasp=grasp, reward=reward)
    CurriculumHook(LinearSchedule(CurriculumConfig(), grasp, reward, FRAMES), env).apply(0)
    assert grasp == GraspConfig()
    assert reward == RewardConfig()
