"""The same problem behind gymnasium's interface."""

from __future__ import annotations

import contextlib
import dataclasses
import gc
from pathlib import Path

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium.utils.env_checker import check_env
from torchrl.envs.utils import step_mdp

import forcegrasp
from forcegrasp.config import GraspConfig, ObservationConfig, PhysicsConfig
from forcegrasp.env import build_env
from forcegrasp.errors import ConfigError
from forcegrasp.models.model_file import read_model
from forcegrasp.physics.scene_renderer import NoRendererError, SceneRenderer

ID = "forcegrasp/Grasp-v0"
PARTS = {"physics": PhysicsConfig("fast", 1), "grasp": GraspConfig(steps=25, radius_m=[0.03, 0.035])}


@pytest.fixture(scope="module")
def opengl() -> None:
    """Skips a test where nothing renders."""
    try:
        with SceneRenderer(8, 8) as renderer:
            renderer.draw(np.array([0.5, -9, 0.03, 0, 0.1]), np.full(2, 0.045), 0.0)
    except NoRendererError as error:
        pytest.skip(str(error))


# Readings have no bounds, of which the checker disapproves.
@pytest.mark.filterwarnings("ignore:.*Box observation space m.* value is -?infinity:UserWarning")
def test_gymnasiums_own_checks():
    check_env(gymnasium.make(ID, **PARTS).unwrapped, skip_render_check=True)


@pytest.mark.filterwarnings("ignore:.*Box observation space m.* value is -?infinity:UserWarning")
def test_gymnasiums_own_checks_of_pictures(opengl):
    with contextlib.closing(gymnasium.make(ID, render_mode="rgb_array", **PARTS)) as env:
        check_env(env.unwrapped)


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


def test_what_builds_it_is_at_the_front_door():
    assert forcegrasp.build_env is build_env


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


def test_pictures_follow_the_grasp(opengl):
    with contextlib.closing(gymnasium.make(ID, render_mode="rgb_array", **PARTS)) as env:
        env.reset(seed=0)
        before = env.render()
        assert (before.shape, before.dtype) == ((360, 480, 3), np.uint8)
        assert len(np.unique(before.reshape(-1, 3), axis=0)) > 20, "the scene must not be blank"
        np.testing.assert_array_equal(env.render(), before)
        for _ in range(5):
            env.step(np.full(2, -1, np.float32))
        assert (env.render() != before).any(), "the fingers must move"
        env.reset(seed=0)
        np.testing.assert_array_equal(env.render(), before)


def test_the_process_that_draws_ends_with_the_environment(opengl):
    env = gymnasium.make(ID, render_mode="rgb_array", **PARTS)
    env.reset(seed=0)
    env.render()
    child = env.unwrapped._renderer._child
    assert child.poll() is None
    env.close()
    assert child.poll() is not None
    assert env.render() is not None, "and another one begins if it is needed"
    child = env.unwrapped._renderer._child
    del env
    gc.collect()
    assert child.poll() is not None


def test_pictures_without_opengl_are_refused_in_a_line(monkeypatch):
    monkeypatch.setenv("MUJOCO_GL", "nonsense")
    env = gymnasium.make(ID, render_mode="rgb_array", **PARTS)
    env.reset(seed=0)
    with pytest.raises(NoRendererError, match="nothing renders with MUJOCO_GL=nonsense; unset") as caught:
        env.render()
    assert "\n" not in str(caught.value)


def test_a_process_that_ended_is_replaced(opengl):
    scene = np.array([0.5, -9, 0.03, 0, 0.1]), np.full(2, 0.045), 0.0
    with SceneRenderer(40, 30) as renderer:
        picture = renderer.draw(*scene)
        assert renderer._child is not None
        renderer._child.kill()
        renderer._child.wait()
        np.testing.assert_array_equal(renderer.draw(*scene), picture)


def test_render_mode_must_be_known():
    with pytest.raises(ConfigError, match="render_mode=ansi: must be rgb_array"):
        gymnasium.make(ID, **PARTS).unwrapped.__class__(render_mode="ansi")


@pytest.mark.filterwarnings("ignore:.*shows nothing:UserWarning")
def test_nothing_is_drawn_unless_it_is_asked_for():
    env = gymnasium.make(ID, **PARTS).unwrapped
    env.reset()
    assert env.render() is None


@pytest.mark.parametrize("kind", [str, Path, read_model])
def test_a_model_may_be_given_as_its_file(root, kind):
    path = str(root / "forcegrasp" / "assets" / "virtual_robot.yaml")
    env = gymnasium.make(ID, model=kind(path), **PARTS)
    plain = gymnasium.make(ID, **PARTS)
    for one in (env, plain):
        one.reset(seed=0)
        info = [one.step(np.full(2, -1, np.float32))[-1] for _ in range(20)][-1]
        one.position = info["measured_position"]
    assert (env.position != plain.position).any()


def test_a_model_of_another_gripper_is_refused(root):
    model = read_model(root / "forcegrasp" / "assets" / "virtual_robot.yaml")
    other = dataclasses.replace(model, gripper=dataclasses.replace(model.gripper, name="robotiq"))
    with pytest.raises(ConfigError, match="model: is of gripper robotiq, and gripper=tiago is asked for"):
        build_env(1, model=other)
