"""Rollouts for evaluation: the grid of softness values, and the same grasps and noise for every policy."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from forcegrasp.config import ActionConfig, GraspConfig, ObservationConfig, PhysicsConfig, RewardConfig, SensorConfig
from forcegrasp.controllers import make_controller
from forcegrasp.env.episodes import summarise
from forcegrasp.evaluate import rollouts
from forcegrasp.evaluate.grids import kappa_grid
from forcegrasp.evaluate.rollouts import roll_out
from forcegrasp.physics import default_gripper
from forcegrasp.physics.completion import complete
from forcegrasp.physics.sampling import offset_limits_m

FAST = PhysicsConfig(tier="fast", threads=1)
NO_BIAS = ActionConfig(inductive_bias=False)


def play(name: str, grasps, grasp: GraspConfig, seed: int = 0, **parts):
    parts = {"physics": FAST, "action": NO_BIAS} | parts
    return roll_out(make_controller(name), grasps, grasp, seed, **parts)


@pytest.mark.parametrize(("limits", "kappas"), [([0.0, 1.0], 11), ([0.2, 0.6], 3), ([0.5, 0.5], 2), ([0.0, 1.0], 1)])
def test_grid_of_softness(limits, kappas):
    grasps = kappa_grid(GraspConfig(kappa=limits), kappas, trials=5, seed=0).grasps
    assert len(grasps) == 5 * kappas
    expected = [limits[0] + (limits[1] - limits[0]) * index / max(1, kappas - 1) for index in range(kappas)]
    np.testing.assert_allclose(grasps.kappa.reshape(kappas, 5), np.array(expected)[:, None].repeat(5, axis=1))


def test_all_else_is_random_and_within_its_range():
    config = complete(GraspConfig(b2=[-12.0, -8.0], radius_m=[0.02, 0.03], offset_m=[-0.005, 0.006]), default_gripper())
    grasps = kappa_grid(config, 5, 200, seed=3).grasps
    assert len(np.unique(grasps.b2)) == len(np.unique(grasps.radius_m)) == 1000
    for name in ("b2", "radius_m", "offset_m"):
        low, high = getattr(config, name)
        values = getattr(grasps, name)
        assert low <= values.min() < low + 0.05 * (high - low)
        assert high - 0.05 * (high - low) < values.max() <= high
    assert (
        np.abs(grasps.offset_m) < offset_limits_m(default_gripper(), grasps.radius_m, config.deformation_m)[1]
    ).all()
    assert (
        grasps.goal_force_n <= 0.95 * 0.30 * default_gripper().training.force_scale(grasps.kappa) * (1 + 1e-12)
    ).all()


def test_grid_depends_on_the_seed_alone():
    one, same, other = (kappa_grid(GraspConfig(), 3, 4, seed).grasps.as_array() for seed in (0, 0, 1))
    assert np.array_equal(one, same)
    assert not np.isclose(one[:, 1:], other[:, 1:]).any()


def test_same_grasps_and_same_noise_for_every_policy():
    config = GraspConfig(steps=20)
    grasps = kappa_grid(config, 2, 3, seed=5).grasps
    one, other = (play(name, grasps, config, seed=5) for name in ("force_pi", "nothing"))
    assert not torch.equal(one["action"], other["action"])
    for episodes in (one, other):
        np.testing.assert_allclose(episodes["grasp_parameters"][:, 0], grasps.as_array(), rtol=1e-6)
    for sensed, true in (("sensed_force", "force"), ("sensed_position", "joint_position")):
        noise, same = (e["next", sensed] - e["next", true] for e in (one, other))
        assert noise.std() > 0
        torch.testing.assert_close(noise, same, atol=1e-6, rtol=0)


def test_noise_differs_between_trials_seeds_and_chunks(monkeypatch):
    config = GraspConfig(steps=5)
    grasps = kappa_grid(config, 2, 2, seed=0).grasps

    def noise(**kwargs):
        episodes = play("nothing", grasps, config, **kwargs)
        return episodes["next", "sensed_force"] - episodes["next", "force"]

    one, other = noise(seed=0), noise(seed=1)
    assert not torch.isclose(one, other).any()
    assert one.flatten(1).unique(dim=0).shape[0] == 4
    monkeypatch.setattr(rollouts, "BATCH", 2)
    assert noise(seed=0).flatten(1).unique(dim=0).shape[0] == 4


def test_chunks_come_back_in_order(monkeypatch):
    config = GraspConfig(steps=3)
    grasps = kappa_grid(config, 5, 1, seed=0).grasps
    monkeypatch.setattr(rollouts, "BATCH", 2)
    episodes = play("close", grasps, config)
    assert episodes.shape == (5, 3)
    np.testing.assert_allclose(episodes["grasp_parameters"][:, 0], grasps.as_array(), rtol=1e-6)


def test_force_pi_twice_is_identical():
    config = GraspConfig(steps=60)
    grasps = kappa_grid(config, 2, 2, seed=0).grasps
    one, other = (play("force_pi", grasps, config) for _ in range(2))
    assert one["next", "force"].any()
    for key in one.keys(include_nested=True, leaves_only=True):
        assert torch.equal(one[key], other[key]), key


def test_episodes_are_whole_and_deterministic():
    config = GraspConfig(steps=7)
    episodes = play("close", kappa_grid(config, 2, 2, seed=0).grasps, config)
    assert episodes.shape == (4, 7)
    assert not episodes["next", "done"][:, :-1].any()
    assert episodes["next", "truncated"][:, -1].all()
    assert "observation" not in set(episodes["next"].keys())


def test_threshold_of_reward_reaches_the_environment():
    config = GraspConfig(steps=60, offset_m=[0.004, 0.004], radius_m=[0.03, 0.03])
    grasps = kappa_grid(config, 2, 2, seed=0).grasps
    strict, lax = (
        summarise(play("close", grasps, config, reward=RewardConfig(speed_threshold_m=limit)), SensorConfig())[
            "fast_steps"
        ]
        for limit in (0.0, 1.0)
    )
    assert (strict > 5).all()
    assert not lax.any()


def test_observation_reaches_the_policy():
    seen = []

    def policy(tensordict):
        seen.append(tensordict["observation"].shape[-1])
        return tensordict.set("action", torch.zeros(2, 2))

    config = GraspConfig(steps=2)
    observation = ObservationConfig(parts=["force", "position"], frames=4)
    roll_out(policy, kappa_grid(config, 1, 2, seed=0).grasps, config, physics=FAST, observation=observation)
    assert set(seen) == {2 * 2 * 4}


def test_fast_physics_agrees_with_the_reference():
    """Within sensor noise: the hand-written controller does as well on both tiers, grasp by grasp."""
    config = GraspConfig()
    grasps = kappa_grid(config, 3, 6, seed=11).grasps
    rewards = [
        summarise(play("force_pi", grasps, config, physics=PhysicsConfig(tier=tier, threads=1)), SensorConfig())[
            "force_reward_normalised"
        ]
        for tier in ("reference", "fast")
    ]
    assert rewards[0].mean() > 80
    assert abs(float(rewards[0].mean() - rewards[1].mean())) < 3
    assert np.corrcoef(*(reward.numpy() for reward in rewards))[0, 1] > 0.9
