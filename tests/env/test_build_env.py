"""The paper's learning problem as a whole: what the policy sees, what its actions do, and that every option counts."""

from __future__ import annotations

import dataclasses
from functools import partial

import numpy as np
import pytest
import torch
from tensordict import TensorDict
from torchrl.envs import ParallelEnv, SerialEnv, TransformedEnv
from torchrl.envs.utils import check_env_specs

from forcegrasp.config import (
    ActionConfig,
    GraspConfig,
    ObservationConfig,
    PhysicsConfig,
    RewardConfig,
    SensorConfig,
)
from forcegrasp.effects import get_effect
from forcegrasp.env import build_env, seed_env
from forcegrasp.env.reward import normalised_force_reward
from forcegrasp.errors import ConfigError
from forcegrasp.models.model_file import Fitted, FoundEffect, Model
from forcegrasp.models.variation import read_model_of
from forcegrasp.physics import FixedGrasps, default_gripper
from forcegrasp.physics.completion import complete
from forcegrasp.physics.gripper_file import load_gripper

FAST = PhysicsConfig(tier="fast", threads=1)
#: Large objects, which both fingers meet within 25 steps.
NEAR = GraspConfig(radius_m=[0.03, 0.035], offset_m=[-0.006, 0.006], steps=40)
EXACT = SensorConfig(position_std_m=0.0, force_std_n=0.0)
STEPS, N = 40, 6


def actions(steps: int = STEPS, n: int = N) -> torch.Tensor:
    """A policy's actions that close at first, some of them beyond [−1, 1]; ``(steps, n, 2)``."""
    generator = torch.Generator().manual_seed(0)
    noise = torch.randn(steps, n, 2, generator=generator)
    bias = torch.where(torch.arange(steps) < 28, -1.0, -0.2).view(-1, 1, 1)
    return bias + 0.4 * noise


def play(env: TransformedEnv, sequence: torch.Tensor | None = None) -> TensorDict:
    """Plays given actions from a reset; batch ``(n, T)``."""
    state, steps = env.reset(), []
    for action in actions(n=env.batch_size[0]) if sequence is None else sequence:
        stepped, state = env.step_and_maybe_reset(state.set("action", action))
        steps.append(stepped)
    return torch.stack(steps, 1)


def build(n: int = N, **parts) -> TransformedEnv:
    return build_env(n, **{"physics": FAST, "grasp": NEAR} | parts)


@pytest.fixture(scope="module")
def rollout() -> TensorDict:
    return play(build())


@pytest.mark.parametrize("action", [ActionConfig(), ActionConfig(inductive_bias=False)])
def test_specs(action):
    check_env_specs(build(3, action=action), seed=0)


def test_observation_is_the_papers(rollout):
    """(q, f, Δf, a(t−1), h) of the last three steps, oldest first; q scaled to ±1, forces in newtons."""
    assert build().observation_spec["observation"].shape == (N, 30)
    after = rollout.get("next")
    sensed, force = after.get("sensed_position").double(), after.get("sensed_force").double()
    sent = rollout.get("action").double().clip(-1, 1)
    had = (force > 0.05).cummax(1).values.double()
    now = torch.cat([sensed / 0.0225 - 1, force, after.get("goal_force").double() - force, sent, had], -1)
    first = rollout[:, 0]
    position, reading = first.get("sensed_position").double(), first.get("sensed_force").double()
    zero = torch.zeros(N, 2, dtype=torch.float64)
    start = torch.cat([position / 0.0225 - 1, reading, first.get("goal_force").double() - reading, zero, zero], -1)
    frames = torch.cat([start.unsqueeze(1).expand(-1, 3, -1), now], 1)  # the first frame fills the stack
    stacked = torch.cat([frames[:, i : i + STEPS + 1] for i in range(3)], -1)
    np.testing.assert_allclose(rollout.get("observation"), stacked[:, :-1], atol=2e-6)
    np.testing.assert_allclose(after.get("observation"), stacked[:, 1:], atol=2e-6)
    assert 0.1 < had.mean() < 0.9


@pytest.mark.parametrize("parts", [["force", "position"], ["had_contact"], ["last_action", "force_error", "force"]])
@pytest.mark.parametrize("frames", [1, 4])
def test_parts_of_the_observation_can_be_left_out(parts, frames):
    after = play(build(observation=ObservationConfig(parts, frames))).get("next")
    size = 2 * len(parts)
    assert after.get("observation").shape == (N, STEPS, size * frames)
    keys = {"position": "scaled_position", "force": "sensed_force"}
    newest = torch.cat([after.get(keys.get(part, part)) for part in parts], -1)
    assert torch.equal(after.get("observation")[..., -size:], newest)


def test_policies_see_what_sensors_say():
    """With a fitted model noise, contact and force error start from what is measured, the reward from the truth."""
    effects = tuple(
        FoundEffect(
            get_effect(name), get_effect(name).variants[0], {key: Fitted(*[v] * 3) for key, v in values.items()}
        )
        for name, values in {
            "force_bias": {"left_n": 0.1, "right_n": -0.2},
            "encoder_bias": {"left_m": 0.001, "right_m": -0.002},
        }.items()
    )
    base = {"position_gain": Fitted(100.0, 100.0, 100.0), "velocity_gain": Fitted(-9.0, -9.0, -9.0)}
    after = play(build(sensors=EXACT, model=Model(load_gripper("tiago"), base, effects=effects))).get("next")
    assert torch.equal(after.get("sensed_force"), after.get("measured_force"))
    assert torch.equal(after.get("sensed_position"), after.get("measured_position"))
    off = after.get("sensed_force") - after.get("force")
    torch.testing.assert_close(off, torch.tensor([0.1, -0.2]).expand_as(off), rtol=0, atol=1e-6)
    assert torch.equal(after.get("force_error"), after.get("goal_force") - after.get("sensed_force"))
    assert after.get("had_contact")[:, 0, 0].all()  # the left finger is taken for touching at once
    true_error = (after.get("goal_force") - after.get("force")).abs().sum(-1, keepdim=True)
    torch.testing.assert_close(after.get(("reward_terms", "force_paper")), 1 - torch.tanh(true_error))


def test_readings_are_noisy_as_configured():
    sensors = SensorConfig(position_std_m=3e-4, force_std_n=0.2)
    rollout = play(build(64, sensors=sensors))
    state = torch.cat(
        [
            rollout.select("sensed_position", "joint_position", "sensed_force", "force")[:, 0],
            rollout.get("next").select("sensed_position", "joint_position", "sensed_force", "force").reshape(-1),
        ]
    )
    position = (state["sensed_position"] - state["joint_position"]).double()
    force = (state["sensed_force"] - state["force"]).double()
    for noise, std in ((position, 3e-4), (force, 0.2)):
        assert noise.std().item() == pytest.approx(std, rel=0.04)
        assert noise.mean().abs().item() < 4 * std / len(noise) ** 0.5
    correlation = torch.corrcoef(torch.cat([position, force], 1).T) - torch.eye(4)
    assert correlation.abs().max() < 5 / len(position) ** 0.5


def test_exact_sensors_read_the_truth():
    after = play(build(sensors=EXACT)).get("next")
    assert torch.equal(after.get("sensed_position"), after.get("joint_position"))
    assert torch.equal(after.get("sensed_force"), after.get("force"))


@pytest.mark.parametrize(
    "config",
    [ActionConfig(), ActionConfig(inductive_bias=False), ActionConfig(0.002, True, 0.3, 0.5, 0.9)],
    ids=["paper", "no bias", "other"],
)
def test_actions_are_clipped_biased_and_scaled(config):
    rollout = play(build(action=config))
    had = rollout.get("had_contact").numpy() > 0.5
    error, goal = (rollout.get(key).double().numpy() for key in ("force_error", "goal_force"))
    both = had.all(-1, keepdims=True)
    force = rollout.get("sensed_force").double().numpy()
    touch = np.maximum.accumulate(np.where(had, force, 0).max(-1, keepdims=True), axis=1)
    last = had.any(-1, keepdims=True) & (config.gentle_touch > 0)
    hard = np.minimum(config.gentle_touch * 1.5, 2 * touch)
    closing = np.where(last, np.minimum(1, np.sqrt(goal / np.maximum(hard, 1e-12))), 1)
    phi = np.where(
        both, np.maximum(config.bias_floor, 1 - np.abs(error) / goal), np.where(had, config.bias_one_contact, closing)
    )
    phi = phi if config.inductive_bias else np.ones_like(phi)
    largest = complete(config, default_gripper()).max_delta_m
    delta = np.clip(rollout.get("action").double().numpy(), -1, 1) * largest * phi
    command = np.clip(rollout.get("joint_position").double().numpy() + delta, 0, 0.045)
    np.testing.assert_allclose(rollout.get(("next", "commanded_position")), command, atol=1e-8)
    assert {True, False} == {*had.ravel()}
    assert both.any()
    assert (rollout.get("action").abs() > 1).any()  # stored as the policy gave it


@pytest.mark.parametrize("config", [RewardConfig(), RewardConfig("goal_normalised", 0.7, 1.4, 0.9, 1e-4)])
def test_reward_is_the_papers(config):
    rollout = play(build(reward=config))
    after = rollout.get("next")
    force, goal, speed = (after.get(key).double().numpy() for key in ("force", "goal_force", "object_speed"))
    error = np.abs(goal - force).sum(-1, keepdims=True)
    r_force = 1 - np.tanh(error if config.form == "paper" else error / goal)
    r_object = -1.0 * (speed > config.speed_threshold_m)
    sent = np.clip(rollout.get("action").double().numpy(), -1, 1)
    r_action = -np.abs(np.diff(sent, axis=1, prepend=0)).sum(-1, keepdims=True)
    expected = config.force_weight * r_force + config.object_weight * r_object + config.action_weight * r_action
    np.testing.assert_allclose(after.get("reward"), expected, atol=4e-6)
    np.testing.assert_allclose(after.get(("reward_terms", "action")), r_action, atol=1e-6)
    assert {-1.0, 0.0} == {*r_object.ravel()}


def test_noise_reaches_neither_state_nor_reward(draw):
    grasps = draw(N, radius_m=[0.03, 0.035])
    unbiased = ActionConfig(inductive_bias=False)
    quiet, noisy = (
        play(build(sampler=FixedGrasps(grasps), action=unbiased, sensors=sensors)).get("next")
        for sensors in (EXACT, SensorConfig())
    )
    for key in ("joint_position", "commanded_position", "force", "object_position", "reward"):
        assert torch.equal(quiet.get(key), noisy.get(key)), key
    assert not torch.equal(quiet.get("observation"), noisy.get("observation"))


def test_partial_reset_starts_memory_anew():
    env = build()
    state = env.reset()
    for action in actions():
        _, state = env.step_and_maybe_reset(state.set("action", action))
        if state["had_contact"].all():
            break
    mask = torch.zeros(N, 1, dtype=torch.bool)
    mask[2] = True
    reset = env.reset(state.clone().set("_reset", mask))
    assert reset["had_contact"].sum(-1).tolist() == [2, 2, 0, 2, 2, 2]
    assert not reset["last_action"][2].any()
    assert torch.equal(reset["observation"][2, :10], reset["observation"][2, 20:])  # no frame of the old episode
    others = torch.arange(N) != 2
    for key in ("observation", "last_action", "force_error", "sensed_force", "joint_position"):
        assert torch.equal(reset[key][others], state[key][others]), key


@pytest.mark.parametrize("apart", [SerialEnv, partial(ParallelEnv, mp_start_method="fork")], ids=["serial", "parallel"])
def test_a_batch_is_its_grasps_one_by_one(draw, apart):
    grasps, sequence = draw(N, radius_m=[0.03, 0.035]), actions()
    together = play(build(sampler=FixedGrasps(grasps), sensors=EXACT), sequence)
    workers = apart(N, [partial(build, 1, sampler=FixedGrasps(grasp), sensors=EXACT) for grasp in grasps])
    try:
        alone = play(workers, sequence[:, :, None]).squeeze(2)
    finally:
        workers.close()
    assert together[:, -1].get(("next", "had_contact")).all(-1).any(), "some grasp must have met the object with both"
    for key in together.keys(include_nested=True, leaves_only=True):
        assert torch.equal(alone.get(key), together.get(key)), key


def test_same_seed_same_rollout():
    def observations(env):
        return play(env).get(("next", "observation"))

    env = build(seed=3)
    first = observations(env)
    assert not torch.equal(first, observations(env))
    seed_env(env, 3)
    assert torch.equal(first, observations(env))
    assert torch.equal(first, observations(build(seed=3)))


def test_seeds_change_grasps_and_noise():
    one, two = (build(seed=seed).reset() for seed in (3, 4))
    assert not torch.equal(one["grasp_parameters"], two["grasp_parameters"])
    noise = [td["sensed_force"] - td["force"] for td in (one, two)]
    assert not torch.equal(*noise)


def test_grasps_do_not_depend_on_the_noise():
    quiet, noisy = (
        play(build(seed=3, sensors=sensors, grasp=dataclasses.replace(NEAR, steps=5)))
        for sensors in (EXACT, SensorConfig())
    )
    assert torch.equal(quiet["grasp_parameters"], noisy["grasp_parameters"])


#: One other value for every option that an environment has.
OTHER = {
    "physics": {"tier": "reference"},
    "grasp": {
        "kappa": [0.0, 0.5],
        "b2": [-9.0, -9.0],
        "servo_gain": "nominal",
        "radius_m": [0.025, 0.035],
        "offset_m": [0.0, 0.0],
        "deformation_m": 0.025,
        "goal_force_min_n": 0.1,
        "goal_force_max": 0.8,
        "steps": 30,
    },
    "sensors": {"position_std_m": 1e-4, "force_std_n": 0.1, "contact_threshold_n": 0.1},
    "observation": {"parts": ["force"], "frames": 2},
    "action": {
        "max_delta_m": 0.002,
        "inductive_bias": False,
        "bias_one_contact": 0.5,
        "bias_floor": 0.2,
        "gentle_touch": 1.0,
    },
    "reward": {
        "form": "goal_normalised",
        "force_weight": 2.0,
        "object_weight": 0.5,
        "action_weight": 0.0,
        "speed_threshold_m": 2e-4,
        "overshoot_weight": 1.0,
        "overshoot_margin": 0.5,
    },
}
BASE = {
    "physics": FAST,
    "grasp": NEAR,
    "sensors": SensorConfig(),
    "observation": ObservationConfig(),
    "action": ActionConfig(),
    "reward": RewardConfig(overshoot_weight=0.1),  # without a weight the margin is nothing
}


def test_every_option_has_another_value():
    for part, config in BASE.items():
        # threads never change a result, and measured forces are the true ones without a model; engine and device:
        # tests/gpu
        unlike = {"threads", "forces", "engine", "device"}
        assert {field.name for field in dataclasses.fields(config)} - unlike == {*OTHER[part]}


@pytest.mark.parametrize(("part", "option"), [(part, option) for part, values in OTHER.items() for option in values])
def test_every_option_changes_something(rollout, part, option):
    other = play(build(**{part: dataclasses.replace(BASE[part], **{option: OTHER[part][option]})}))
    keys = [("next", key) for key in ("observation", "reward", "joint_position", "goal_force", "truncated")]
    same = [a.shape == b.shape and torch.equal(a, b) for a, b in ((other.get(key), rollout.get(key)) for key in keys)]
    assert not all(same)


def test_reward_of_measured_forces_is_that_of_a_models_sensors():
    model = read_model_of(load_gripper("tiago"), "virtual_robot")  # whose force sensors have a dead zone
    for forces, key in (("actual", "force"), ("measured", "measured_force")):
        reward = RewardConfig("goal_normalised", object_weight=0.0, action_weight=0.0, forces=forces)
        after = play(build(reward=reward, model=model))["next"]
        goal = after["goal_force"]
        torch.testing.assert_close(after["reward"], normalised_force_reward(goal - after[key], goal))
        assert not torch.allclose(after["force"], after["measured_force"])


@pytest.mark.parametrize(
    "parts",
    [
        {"sensors": SensorConfig(force_std_n=-1.0)},
        {"observation": ObservationConfig(frames=0)},
        {"action": ActionConfig(max_delta_m=-0.003)},
        {"reward": RewardConfig(form="mine")},
    ],
    ids=["noise", "frames", "delta", "form"],
)
def test_options_out_of_range_are_refused(parts):
    with pytest.raises(ConfigError):
        build(1, **parts)
