"""PPO's written-out gradient against autograd's: on every preset, and with every option that it depends on."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import torch
from torch import Tensor

from forcegrasp.cli.options import compose
from forcegrasp.physics import load_gripper
from forcegrasp.physics.completion import complete
from forcegrasp.train.algorithms.ppo import PPO, one_gradient
from forcegrasp.train.algorithms.written_gradient import WrittenGradient, can_be_written
from forcegrasp.train.loop import Trainer

EXPERIMENTS = sorted(path.stem for path in (Path(__file__).parents[2] / "conf/experiment").glob("*.yaml"))
SMALL = ["ppo.grasps=4", "grasp.steps=40", "physics.threads=1", "curriculum.enabled=false"]
TAUGHT = "experiment=recommended"


def trainer(*overrides: str) -> Trainer:
    config = compose("train", [*SMALL, *overrides])
    return Trainer(complete(config, load_gripper(config.gripper)))


def prepared(made: Trainer):
    """Its algorithm, and frames on which no term of its gradient vanishes."""
    algorithm = made.algorithm
    assert isinstance(algorithm, PPO)
    with torch.no_grad():  # away from the start, where the policy's mean hardly depends on what it sees
        for parameter in [*algorithm.policy.parameters(), *algorithm.value.parameters()]:
            parameter += 0.1 * torch.randn_like(parameter)
    batch = made.collect()[0]
    algorithm.prepare(batch)
    batch["action_log_prob"] += 0.3 * torch.randn(batch.shape)  # some ratios lie beyond the clip
    return algorithm, algorithm.samples(batch)[0][torch.randperm(batch.numel())[:100]]


def gradient_by(way: Callable[[Any], dict[str, Tensor]], algorithm: PPO, frames: Any):
    """Each parameter's gradient by a way to compute it, and what that tells."""
    networks = {"policy": algorithm.policy, "value": algorithm.value}
    for net in networks.values():
        one_gradient(net.parameters())
    told = way(frames)
    return {f"{k}.{n}": p.grad for k, net in networks.items() for n, p in net.named_parameters()}, told


@pytest.mark.parametrize(
    "overrides",
    [
        *([f"experiment={name}"] for name in EXPERIMENTS if name not in ("recurrent", "sac")),
        [TAUGHT, "gripper=so101_gripper"],
        [TAUGHT, "gripper=franka_hand", "ppo.teacher_caution=3"],
        ["ppo.critic=observation", "ppo.entropy_weight=0.3", "ppo.clip=0.05", "ppo.value_weight=2"],
        ["ppo.mirrored=false", "ppo.hidden=[7]", "ppo.discount=0.9"],
        ["ppo.log_std=-10"],
    ],
    ids=" ".join,
)
def test_it_is_autograds(overrides):
    algorithm, frames = prepared(trainer(*overrides))
    assert can_be_written(algorithm.policy, algorithm.critic)
    way = WrittenGradient(algorithm.policy, algorithm.critic, algorithm.objective)
    written, told = gradient_by(way, algorithm, frames)
    expected, as_told = gradient_by(algorithm.gradient, algorithm, frames)
    assert written.keys() == expected.keys()
    for name, gradient in expected.items():
        scale = float(gradient.abs().max())
        torch.testing.assert_close(written[name], gradient, rtol=1e-4, atol=1e-4 * scale + 1e-9, msg=name)
    assert told.keys() == as_told.keys()
    for name, value in as_told.items():
        torch.testing.assert_close(told[name], value, rtol=1e-4, atol=1e-6, msg=name)


def test_a_training_takes_it_wherever_it_can(monkeypatch):
    made = trainer()
    monkeypatch.setattr(made.algorithm, "gradient", None)  # by autograd
    made.algorithm.update(made.collect()[0])


@pytest.mark.parametrize("overrides", [["experiment=recurrent"], []], ids=["memory", "float64"])
def test_other_networks_are_left_to_autograd(overrides):
    algorithm = trainer(*overrides).algorithm
    assert isinstance(algorithm, PPO)
    if not overrides:
        algorithm.policy.double()
    assert not can_be_written(algorithm.policy, algorithm.critic)
