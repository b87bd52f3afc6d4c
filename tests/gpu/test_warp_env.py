"""The environment on MuJoCo Warp: as on MuJoCo, and it trains, evaluates and is saved alike."""

from __future__ import annotations

import dataclasses

import pytest
import torch
from torchrl.envs.utils import check_env_specs

from forcegrasp.config import GraspConfig, PhysicsConfig, SensorConfig, TrainConfig
from forcegrasp.controllers import make_controller
from forcegrasp.env import GraspEnv, build_env
from forcegrasp.evaluate.rollouts import roll_out
from forcegrasp.train.loop import Trainer

pytestmark = pytest.mark.usefixtures("warp")
WARP, MUJOCO = PhysicsConfig("fast", engine="warp"), PhysicsConfig("fast", threads=1)
NEAR = GraspConfig(radius_m=[0.03, 0.035], steps=12)


def test_specs():
    check_env_specs(GraspEnv(2, WARP, dataclasses.replace(NEAR, steps=3)), seed=0)


def test_episodes_are_those_of_the_usual_engine():
    """Noise apart, which lies upon it: even grasps and their goals are drawn alike."""
    closing = [build_env(6, physics=physics, grasp=NEAR, seed=3) for physics in (WARP, MUJOCO)]
    own, known = (env.rollout(12, make_controller("close"), break_when_any_done=False) for env in closing)
    assert {*own.keys(True, True)} == {*known.keys(True, True)}
    for key in known.keys(True, True):
        torch.testing.assert_close(own[key], known[key], rtol=1e-3, atol=3e-3, msg=str(key))
    assert own["next", "truncated"][:, -1].all()


def test_partial_reset():
    env = GraspEnv(3, WARP, NEAR)
    state = env.rollout(4, break_when_any_done=False).get("next")[:, -1].exclude("reward")
    reset = env.reset(state.clone().set("_reset", torch.tensor([[False], [True], [False]])))
    for key in ("joint_position", "force", "object_position", "grasp_parameters", "commanded_position"):
        assert torch.equal(reset[key][[0, 2]], state[key][[0, 2]]), key
    assert not torch.equal(reset["grasp_parameters"][1], state["grasp_parameters"][1])
    assert torch.equal(reset["joint_position"][1], torch.full((2,), 0.045))


def test_evaluation(draw):
    grasps = draw(3, radius_m=[0.03, 0.035])
    parts = {"sensors": SensorConfig(force_std_n=0.0, position_std_m=0.0), "seed": 1}
    own, known = (
        roll_out(make_controller("force_pi"), grasps, NEAR, physics=physics, **parts) for physics in (WARP, MUJOCO)
    )
    torch.testing.assert_close(own["next", "force"], known["next", "force"], rtol=1e-3, atol=1e-3)


def test_training():
    """One batch and its update; what is saved brings another training to the same point."""
    config = TrainConfig(physics=WARP, grasp=NEAR)
    config.ppo.grasps, config.ppo.minibatch, config.ppo.hidden = 4, 24, [8]
    trainer = Trainer(config)
    before = [p.clone() for p in trainer.policy.parameters()]
    batch = next(iter(trainer.collector))
    assert batch.shape == (4, 12)
    losses = trainer.algorithm.update(batch)
    assert all(torch.isfinite(torch.tensor(value)) for value in losses.values())
    assert any(not torch.equal(a, b) for a, b in zip(before, trainer.policy.parameters(), strict=True))
    tensors, facts = trainer.state()
    following = next(iter(trainer.collector))
    other = Trainer(config)
    other.restore(tensors, facts | {"frames": 48})
    assert torch.equal(next(iter(other.collector))["next", "observation"], following["next", "observation"])
