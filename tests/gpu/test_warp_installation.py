"""What is missing is told in one line, before anything is imported or written."""

from __future__ import annotations

import pytest
import torch

from forcegrasp.config import GraspConfig, PhysicsConfig
from forcegrasp.env import GraspEnv
from forcegrasp.errors import ConfigError
from forcegrasp.gpu import check_engine, installation
from forcegrasp.models.variation import read_model_of
from forcegrasp.physics import default_gripper


@pytest.fixture
def installed(monkeypatch):
    monkeypatch.setattr(installation, "find_spec", lambda name: name)


def test_the_usual_engine_needs_nothing(monkeypatch):
    monkeypatch.setattr(installation, "find_spec", lambda name: None)
    check_engine(PhysicsConfig())


@pytest.mark.parametrize("missing", ["mujoco_warp", "warp"])
def test_not_installed(missing, monkeypatch):
    monkeypatch.setattr(installation, "find_spec", lambda name: None if name == missing else name)
    with pytest.raises(ConfigError, match=r"not installed: pip install 'forcegrasp\[warp\]'"):
        GraspEnv(2, PhysicsConfig("fast", engine="warp"))


def test_no_gpu(installed, monkeypatch):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    check_engine(PhysicsConfig(engine="warp"))
    with pytest.raises(ConfigError, match=r"physics.device=cuda: torch .* finds no GPU.*use physics.device=cpu"):
        GraspEnv(2, PhysicsConfig("fast", engine="warp", device="cuda"))


def test_a_device_that_the_engine_cannot_use():
    with pytest.raises(ConfigError, match=r"physics.device=cuda: engine mujoco runs on the CPU; add physics=warp"):
        GraspEnv(2, PhysicsConfig(device="cuda"))


def test_no_effects(installed):
    with pytest.raises(ConfigError, match="model: engine warp simulates the nominal gripper alone"):
        GraspEnv(
            2, PhysicsConfig(engine="warp"), GraspConfig(), model=read_model_of(default_gripper(), "virtual_robot")
        )
