"""The same problem behind gymnasium's interface."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium.utils.env_checker import check_env
from torchrl.envs.utils import step_mdp

import forcegrasp  # noqa: F401 - registers the environment
from forcegrasp.config import GraspConfig, ObservationConfig, PhysicsConfig
from forcegrasp.env import build_env

ID = "forcegrasp/Grasp-v0"
PARTS = {"physics": PhysicsConfig("fast", 1), "grasp": GraspConfig(steps=25, radius_m=[0.03, 0.035])}


# Readings have no bounds, of which the checker disapproves.
@pytest.mark.filterwarnings("ignore:.*Box observation space m.* value is -?infinity:UserWarning")
def test_gymnasiums_own_checks():
    check_env(gymnasium.make(ID, **PARTS).unwrapped)


def test_spaces():
    env = gymnasium.make(ID, observation=ObservationConfig(parts=["force", "position"], frames=2))
    assert env.observation_space.shape == (8,)
    assert gymnasium.make(ID).observation_space.shape == (30,)
    assert (env.action_space.low, env.action_space.high) == (pytest.approx(-1), pytest.approx(1))
    assert env.action_space.shape == (2,)


def test_same_trajectory_as_the_torchrl_environment():
    view, env = gymnasium.make(ID, **PARTS), build_env(1, seed=5, **PARTS)
    observation, info = view.reset(seed=5)
    state = env.reset()
    np.testing.assert_array_equal(observation, state["observation"][0])
    for action in np.random.default_rng(0).uniform(-1, -0.4, (25, 2)).astype(np.float32):
        observation, reward, terminated, truncated, info = view.step(action)
        stepped = env.step(state.set("action", torch.from_numpy(action).unsqueeze(0)))
        after, state = stepped["next"], step_mdp(stepped)
        np.testing.assert_array_equal(observation, after["observation"][0])
        assert reward == after["reward"].item()
        assert (terminated, truncated) == (False, after["truncated"].item())
        for key in ("joint_position", "force", "goal_force", "object_position", "grasp_parameters"):
            np.testing.assert_array_equal(info[key], after[key][0])
    assert truncated
    assert info["force"].any()


def test_seeds():
    view = gymnasium.make(ID, **PARTS)
    grasps = [view.reset(seed=seed)[1]["grasp_parameters"] for seed in (1, None, 1, 2)]
    np.testing.assert_array_equal(grasps[0], grasps[2])
    assert (grasps[0] != grasps[1]).all()
    assert (grasps[0] != grasps[3]).all()


def test_seed_of_the_constructor_holds_until_the_first_seeded_reset():
    made = gymnasium.make(ID, seed=1, **PARTS).reset()[0]
    np.testing.assert_array_equal(made, gymnasium.make(ID, **PARTS).reset(seed=1)[0])


def test_step_needs_a_reset():
    with pytest.raises(gymnasium.error.ResetNeeded):
        gymnasium.make(ID, **PARTS).unwrapped.step(np.zeros(2, np.float32))


def test_what_is_handed_out_stays_as_it_was():
    view = gymnasium.make(ID, **PARTS)
    observation, info = view.reset(seed=0)
    kept = observation.copy(), info["joint_position"].copy()
    for _ in range(5):
        view.step(np.full(2, -1, np.float32))
    np.testing.assert_array_equal(observation, kept[0])
    np.testing.assert_array_equal(info["joint_position"], kept[1])
