"""Recurrent PPO: sequences are learned from as they were acted, through all their steps, and the memory is of use."""

from __future__ import annotations

import pytest
import torch
from tensordict import TensorDict
from torchrl.data import Bounded, Categorical, Composite, Unbounded
from torchrl.envs import EnvBase, TransformedEnv
from torchrl.envs.utils import ExplorationType, set_exploration_type

from forcegrasp.env import with_memory
from forcegrasp.physics import default_gripper
from forcegrasp.train.algorithms import RecurrentPPO
from forcegrasp.train.loop import Trainer

MEMORY = {"memory": 4, "minibatch": 60}


class Recall(EnvBase):
    """A cue of ±1 is shown at the first of four steps; the reward of each later one is −(mean action − cue)²."""

    def __init__(self, n: int) -> None:
        super().__init__(batch_size=(n,))
        self.observation_spec = Composite(observation=Unbounded((n, 2)), shape=(n,))
        self.action_spec = Bounded(-1, 1, (n, 2))
        self.reward_spec = Unbounded((n, 1))
        self.full_done_spec = Composite(
            {key: Categorical(2, (n, 1), dtype=torch.bool) for key in ("done", "terminated", "truncated")}, shape=(n,)
        )

    def _reset(self, tensordict=None):
        self.step_count, self.cue = 0, torch.randint(2, (*self.batch_size, 1)) * 2.0 - 1
        return TensorDict({"observation": self.cue.expand(-1, 2)}, self.batch_size)

    def _step(self, tensordict):
        reward = -(tensordict["action"].mean(-1, keepdim=True) - self.cue).square() * (self.step_count > 0)
        self.step_count += 1
        nothing = torch.zeros_like(tensordict["action"])
        over = torch.full((*self.batch_size, 1), self.step_count >= 4)
        done = {"done": over, "truncated": over, "terminated": torch.zeros_like(over)}
        return TensorDict({"observation": nothing, "reward": reward, **done}, self.batch_size)

    def _set_seed(self, seed):
        torch.manual_seed(seed)


@pytest.mark.long
@pytest.mark.parametrize("mirrored", [True, False])
def test_what_only_a_memory_can_know_is_learned(mirrored, tiny):
    """Without a memory, or with one that does nothing, no policy does better than −1 a step."""
    torch.manual_seed(1)
    options = {"hidden": [16], "memory": 8, "minibatch": 128, "epochs": 4, "learning_rate": 0.01, "log_std": -1.0}
    options |= {"critic": "observation", "initial_action": 0.0, "discount": 0.5, "mirrored": mirrored}
    config = tiny(ppo=options, observation={"parts": ["force_error"], "frames": 1})
    env = TransformedEnv(Recall(64))
    algorithm = RecurrentPPO(config, env, default_gripper())
    with_memory(env, algorithm.policy)
    for _ in range(40):
        with torch.no_grad(), set_exploration_type(ExplorationType.RANDOM):
            batch = env.rollout(4, algorithm.policy)
        algorithm.update(batch)
    with torch.no_grad(), set_exploration_type(ExplorationType.DETERMINISTIC):
        reward = env.rollout(4, algorithm.policy)["next", "reward"][:, 1:]
    assert reward.mean() > -0.3


@pytest.fixture
def trainer(tiny):
    return Trainer(tiny(ppo=MEMORY | {"grasps": 4}))


def next_batch(trainer: Trainer) -> TensorDict:
    return trainer.collect()[0]


def test_minibatches_are_whole_grasps_and_the_first_is_as_it_was_acted(trainer, monkeypatch):
    batch, seen, kl = next_batch(trainer), [], []
    gradient = trainer.algorithm.gradient

    def noted(frames):
        told = gradient(frames)
        seen.append(frames.shape)
        kl.append(float(told["kl_approx"]))
        return told

    monkeypatch.setattr(trainer.algorithm, "gradient", noted)
    trainer.algorithm.update(batch)
    assert seen == [(2, 30)] * 4
    assert abs(kl[0]) < 1e-6 < abs(kl[1])


def test_gradients_go_back_through_the_grasp(trainer):
    """The loss of the last step alone moves what the first observation goes through."""
    batch = next_batch(trainer)
    policy = trainer.policy
    observation = batch["observation"].clone().requires_grad_()
    sequence = TensorDict({"observation": observation, "is_init": batch["is_init"]}, batch.shape)
    from torchrl.modules import set_recurrent_mode

    with torch.no_grad():
        for parameter in policy.parameters():
            parameter.normal_(0.0, 0.5)
    with set_recurrent_mode(True):
        policy[0](sequence)["loc"][:, 5].sum().backward()
    reached = observation.grad.abs().sum(-1)
    assert (reached[:, :6] > 0).all()
    assert (reached[:, 6:] == 0).all()


def test_memories_begin_at_zero_with_every_episode(trainer):
    for _ in range(2):
        batch = next_batch(trainer)
        assert batch["is_init"].squeeze(-1).sum(1).tolist() == [1] * 4
        for key in ("memory", "mirrored_memory"):
            assert (batch[key][:, 0] == 0).all()
            assert (batch[key][:, 1:] != 0).any(-1).all()
