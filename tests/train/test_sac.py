"""Soft actor-critic: what it keeps, what its networks follow, and that it learns."""

from __future__ import annotations

import pytest
import torch
from tensordict import TensorDict

from forcegrasp.train.loop import Trainer

SAC = {"total_frames": 300, "grasps": 2, "hidden": [8], "buffer": 150, "updates": 2, "minibatch": 16}


@pytest.fixture
def make(tiny):
    def made(**options) -> Trainer:
        config = tiny(sac=SAC | options)
        config.learner = "sac"
        return Trainer(config)

    return made


def next_batch(trainer: Trainer) -> TensorDict:
    return trainer.collect()[0]


def test_the_newest_transitions_are_kept(make):
    trainer = make()
    batches = [next_batch(trainer) for _ in range(4)]  # 60 transitions each
    for batch in batches:
        reported = trainer.algorithm.update(batch.clone())
    assert reported["buffer"] == 150
    kept = trainer.algorithm.buffer[:]
    newest = torch.cat([batch.reshape(-1) for batch in batches])[-150:]
    for key in ("observation", "action", ("next", "observation"), ("next", "reward"), "grasp_parameters"):
        rows, expected = (values.reshape(150, -1).tolist() for values in (kept[key], newest[key]))
        assert sorted(rows) == sorted(expected)


def test_targets_follow_slowly_and_the_weight_of_the_entropy_its_target(make):
    trainer = make(target_rate=0.1, updates=1)
    loss = trainer.algorithm.loss
    net = ("module", "value", "net", "2", "weight")
    target = loss.target_qvalue_network_params[net].clone()
    log_alpha = loss.log_alpha.item()
    reported = trainer.algorithm.update(next_batch(trainer))
    expected = target.lerp(loss.qvalue_network_params[net].data, 0.1)
    torch.testing.assert_close(loss.target_qvalue_network_params[net], expected)
    assert not torch.equal(loss.target_qvalue_network_params[net], target)
    too_much = reported["entropy"] > 2 * trainer.algorithm.config.entropy_target  # of two motors
    assert (loss.log_alpha.item() < log_alpha) == too_much


@pytest.mark.parametrize("entropy_target", [-20.0, 2.0])
def test_entropy_has_a_target_for_each_motor(make, entropy_target):
    loss = make(entropy_target=entropy_target).algorithm.loss
    assert float(loss.target_entropy) == 2 * entropy_target


def test_actions_are_squashed(make):
    trainer = make(log_std=2.0)
    actions = next_batch(trainer)["action"]
    assert actions.abs().max() <= 1
    assert (actions.abs() > 0.99).any()


@pytest.mark.parametrize("initial", [-1.0, -0.5, 0.7])
def test_initial_action_is_that_of_the_squashed_policy(make, initial):
    policy = make(initial_action=initial).policy
    with torch.no_grad():
        action = policy(TensorDict({"observation": torch.zeros(1, 30)}, [1]))["action"]
    torch.testing.assert_close(action, torch.full((1, 2), max(initial, -0.99)), atol=1e-2, rtol=0)


def test_values_are_learned_from_the_true_state_only_if_privileged(make):
    for critic, privileged in (("privileged", True), ("observation", False)):
        algorithm = make(critic=critic).algorithm
        assert ("grasp_parameters" in algorithm.keys) == privileged


@pytest.mark.parametrize("better", [-1.0, 1.0])
def test_the_better_action_is_learned(make, better):
    """Of actions in a made-up problem, whose reward is the action, or minus it."""
    options = {"updates": 60, "learning_rate": 5e-3, "discount": 0.5, "critic": "observation", "initial_action": 0.0}
    trainer = make(**options, minibatch=64, buffer=600)
    batch = torch.cat([next_batch(trainer) for _ in range(2)])
    batch["action"] = torch.rand_like(batch["action"]) * 2 - 1
    batch["next", "reward"] = better * batch["action"].sum(-1, keepdim=True)
    trainer.algorithm.update(batch)
    with torch.no_grad():
        action = trainer.policy(batch.select("observation").reshape(-1))["loc"].tanh()
    assert better * action.mean() > 0.5
