"""A part of the observation is a transform and a line in a list: options, training, evaluation and export follow."""

from __future__ import annotations

import dataclasses
import sys
from types import ModuleType

import numpy as np
import pytest
import torch
from torchrl.data import Unbounded
from torchrl.envs import check_env_specs
from torchrl.envs.transforms import Transform

from forcegrasp.config import ObservationConfig, PPOConfig, TrainConfig, validate
from forcegrasp.controllers.mean_network import Mirrored
from forcegrasp.controllers.policy import policy_of
from forcegrasp.deploy import GraspController
from forcegrasp.env import build_env
from forcegrasp.errors import ConfigError, DeployError
from forcegrasp.observation import DEFAULT_PARTS, PARTS, Part
from forcegrasp.physics import default_gripper
from forcegrasp.runs.export import export_policy
from forcegrasp.runs.policy import load_policy
from forcegrasp.runs.run_dir import RunDir

SEEN = ObservationConfig(["grip_width", "force", "grip_width_twice"], frames=2)


class GripWidth(Transform):
    """The distance between the fingers, metres, ``(*B, 1)``, and twice as much."""

    def __init__(self) -> None:
        super().__init__(in_keys=["sensed_position"], out_keys=["grip_width", "grip_width_twice"])

    def _call(self, next_tensordict):
        width = next_tensordict["sensed_position"].sum(-1, keepdim=True)
        return next_tensordict.set("grip_width", width).set("grip_width_twice", 2 * width)

    def _reset(self, tensordict, tensordict_reset):
        return self._call(tensordict_reset)

    def transform_observation_spec(self, observation_spec):
        for key in self.out_keys:
            observation_spec[key] = Unbounded(shape=torch.Size([*observation_spec.shape, 1]))
        return observation_spec


@pytest.fixture
def grip_width(monkeypatch) -> None:
    """A module of transforms with two parts, as if it were the package's."""
    module = ModuleType("grip_width")
    module.make = lambda gripper, sensors: GripWidth()
    monkeypatch.setitem(sys.modules, "forcegrasp.transforms.grip_width", module)
    for name in SEEN.parts[::2]:
        monkeypatch.setitem(PARTS, name, Part(name, "grasp", "m", transform="grip_width"))


@pytest.fixture
def run(grip_width, tmp_path) -> RunDir:
    """A training's start."""
    config = TrainConfig(observation=SEEN, ppo=PPOConfig(hidden=[4]))
    run = RunDir.create(tmp_path / "run", config, [])
    torch.manual_seed(0)
    policy = policy_of(config, default_gripper())
    run.save(0, {f"policy.{name}": tensor for name, tensor in policy.state_dict().items()}, {}, keep=1)
    return run


def test_options_take_listed_parts_only(grip_width):
    validate(SEEN, "observation.")
    with pytest.raises(ConfigError, match=r"must be one of position, .*grip_width"):
        validate(ObservationConfig(["width"]), "observation.")
    assert ObservationConfig().parts == list(DEFAULT_PARTS)


def test_the_environment_shows_it(grip_width):
    env = build_env(2, observation=SEEN)
    assert sum(isinstance(t, GripWidth) for t in env.transform) == 1
    check_env_specs(env, seed=0)
    seen = env.rollout(3)
    width = seen["sensed_position"].sum(-1, keepdim=True)
    torch.testing.assert_close(seen["observation"][..., 4:], torch.cat([width, seen["sensed_force"], 2 * width], -1))


def test_a_policy_is_loaded_and_keeps_the_grasps_own_numbers_in_its_mirror(run):
    policy, _ = load_policy(run.path)
    (mirrored,) = [module for module in policy.modules() if isinstance(module, Mirrored)]
    assert mirrored.mirror.order.tolist() == [0, 2, 1, 3, 4, 6, 5, 7]
    observation = torch.arange(8.0)
    swapped = observation[mirrored.mirror.order]
    torch.testing.assert_close(mirrored(observation), mirrored(swapped).flip(-1))


def test_export_refuses_it_without_a_form_on_a_robot(run, tmp_path):
    with pytest.raises(DeployError, match=r"run: observation\.parts: grip_width has no form on a robot.*train without"):
        export_policy(run.path, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_robot_has_it_with_its_form(run, tmp_path, monkeypatch):
    for factor, name in enumerate(SEEN.parts[::2], 1):
        form = dataclasses.replace(PARTS[name], on_robot=lambda r, k=factor: k * r.position.sum(keepdims=True))
        monkeypatch.setitem(PARTS, name, form)
    export_policy(run.path, tmp_path / "out")
    controller, env = GraspController.load(tmp_path / "out"), build_env(1, observation=SEEN, gripper=default_gripper())
    seen = env.reset()
    controller.reset(float(seen["goal_force"]))
    controller.step(seen["sensed_position"][0].numpy(), seen["sensed_force"][0].numpy())
    with torch.no_grad():
        policy, _ = load_policy(run.path)
        expected = policy.get_submodule("module.0")(seen)["loc"][0].numpy()
    np.testing.assert_allclose(controller.action, expected, atol=1e-5)
