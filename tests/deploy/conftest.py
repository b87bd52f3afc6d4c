"""Policies with random weights that close, and what is exported of them."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest
import torch
from torch import nn

from forcegrasp.config import ActionConfig, GraspConfig, PhysicsConfig, PPOConfig, SensorConfig, TrainConfig
from forcegrasp.controllers.policy import network_of, policy_of
from forcegrasp.physics import default_gripper, load_gripper
from forcegrasp.runs.export import export_policy
from forcegrasp.runs.run_dir import RunDir

#: Objects that the fingers reach within a second, one some time after the other.
NEAR = GraspConfig(radius_m=[0.03, 0.035], offset_m=[-0.006, 0.006])
TRAINING = TrainConfig(grasp=NEAR, physics=PhysicsConfig("fast", 1), ppo=PPOConfig(hidden=[16]))

Make = Callable[..., tuple[Path, TrainConfig]]


@pytest.fixture(scope="session", autouse=True)
def one_table_of_operators() -> Iterator[None]:
    """Torch makes its table of ONNX operators anew for each export, which takes half of the export's time."""
    from torch.onnx._internal.exporter._registration import ONNXRegistry

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ONNXRegistry, "from_torchlib", staticmethod(cache(ONNXRegistry.from_torchlib)))
        yield


@pytest.fixture(scope="session")
def make_run(tmp_path_factory) -> Make:
    """``make_run(**parts)``: a run with random weights, and its configuration."""

    def make(**parts) -> tuple[Path, TrainConfig]:
        config = replace(TRAINING, **parts)
        torch.manual_seed(0)
        gripper = load_gripper(config.gripper)
        policy = policy_of(config, gripper)
        with torch.no_grad():
            for tensor in policy.parameters():  # much of [-1, 1], and beyond
                tensor.normal_(0.0, 0.4)
            last = [module for module in network_of(policy).modules() if isinstance(module, nn.Linear)][-1]
            last.bias.fill_(-1.0)
        run = RunDir.create(tmp_path_factory.mktemp("deploy") / "run", config, [])
        run.save(0, {f"policy.{name}": tensor.clone() for name, tensor in policy.state_dict().items()}, {}, keep=1)
        return run.path, config

    return make


@pytest.fixture(scope="session")
def exported(make_run, tmp_path_factory) -> Path:
    """A folder that forcegrasp export wrote. Copy it before you change it."""
    out = tmp_path_factory.mktemp("exported") / "policy"
    run, _ = make_run(sensors=SensorConfig(), action=ActionConfig())
    export_policy(run, out)
    return out


@pytest.fixture(scope="session")
def one_sensor(tmp_path_factory) -> Path:
    """The description of a gripper with two motors, one of whose fingers has a force sensor."""
    folder, shipped = tmp_path_factory.mktemp("one_sensor"), default_gripper()
    text = shipped.path.read_text().replace(", force_sensor: force_r}", "}")
    (folder / "one_sensor.yaml").write_text(text.replace(f"name: {shipped.name}", "name: one_sensor"))
    shutil.copy(shipped.model, folder)
    return folder / "one_sensor.yaml"
