"""The lean way to collect episodes against TorchRL's own collector: the same batch, to the last bit."""

from __future__ import annotations

import pytest
import torch
from tensordict import TensorDictBase
from torchrl.collectors import Collector
from torchrl.envs.transforms import Transform

from forcegrasp.cli.options import compose
from forcegrasp.env.build import seed_env
from forcegrasp.physics import load_gripper
from forcegrasp.physics.completion import complete
from forcegrasp.train.collector import collecting
from forcegrasp.train.episodes import can_collect, collect
from forcegrasp.train.loop import Trainer

SMALL = ["ppo.grasps=3", "grasp.steps=12", "ppo.hidden=[4]", "ppo.initial_action=-1", "physics.threads=1"]


def trainer(*overrides: str) -> Trainer:
    config = compose("train", [*SMALL, *overrides])
    return Trainer(complete(config, load_gripper(config.gripper)))


def seeded(made: Trainer) -> Trainer:
    """Generators as at the start, whatever making it drew."""
    torch.manual_seed(7)
    seed_env(made.env, 7)
    return made


def by_torchrl(made: Trainer) -> TensorDictBase:
    steps = made.config.grasp.steps
    options = {"reset_at_each_iter": True, "track_traj_ids": False, "auto_register_policy_transforms": False}
    collector = Collector(made.env, made.policy, frames_per_batch=made.env.batch_size[0] * steps, **options)
    seeded(made)
    return next(iter(collector))


@pytest.mark.parametrize(
    "overrides",
    [
        *(
            [f"experiment={name}"]
            for name in ("ib", "no_ib", "no_rand", "recommended", "no_stacking", "no_last_action")
        ),
        ["gripper=so101_gripper", "experiment=no_rand"],
        ["gripper=franka_hand", "experiment=recommended"],
    ],
    ids=" ".join,
)
def test_same_batch_as_torchrl(overrides):
    expected = by_torchrl(trainer(*overrides))
    made = seeded(trainer(*overrides))
    assert can_collect(made.env, made.policy)
    batch = collect(made.env, made.policy, 12)
    assert set(batch.keys(True, True)) == set(expected.keys(True, True))
    for key in expected.keys(True, True):
        assert torch.equal(batch.get(key), expected.get(key)), key
    assert batch["force"].any() or "so101" in " ".join(overrides), "the fingers must arrive"


class OfAUser(Transform):
    """Asks more of a tensordict than the package's own transforms do."""

    def _call(self, next_tensordict):
        total = next_tensordict.select("force", "measured_force").apply(lambda value: value.sum(-1, keepdim=True))
        return next_tensordict.update({"total": total["force"], "nested": {"total": total["measured_force"]}})

    def _reset(self, tensordict, tensordict_reset):
        return self._call(tensordict_reset)

    def transform_observation_spec(self, observation_spec):
        observation_spec["total"] = observation_spec["goal_force"].clone()
        observation_spec["nested", "total"] = observation_spec["goal_force"].clone()
        return observation_spec


def test_transforms_of_a_user_get_tensordicts():
    made = trainer()
    made.env.append_transform(OfAUser())
    expected = by_torchrl(made)
    made = trainer()
    made.env.append_transform(OfAUser())
    batch = collect(seeded(made).env, made.policy, 12)
    assert set(batch.keys(True, True)) == set(expected.keys(True, True))
    for key in ("total", ("nested", "total"), "observation", ("next", "nested", "total"), ("next", "reward")):
        assert torch.equal(batch.get(key), expected.get(key)), key


def test_a_training_collects_so(monkeypatch):
    monkeypatch.setattr(Collector, "rollout", None)
    assert next(iter(trainer().collector)).shape == (3, 12)


class Hooked(Transform):
    """Changes what the step after starts from, which only TorchRL's own step allows for."""

    def _post_step_mdp_hooks(self, tensordict, tensordict_):
        tensordict_["observation"] = tensordict_["observation"] + 1
        return tensordict, tensordict_


def test_what_it_cannot_do_is_left_to_torchrl():
    made = trainer()
    assert can_collect(made.collector.env, made.policy)
    made.collector.env.append_transform(Hooked())
    assert not can_collect(made.collector.env, made.policy)
    batch = next(iter(made.collector))
    assert torch.equal(batch["observation"][:, 1:], batch["next", "observation"][:, :-1] + 1)


def test_ahead_the_policy_is_one_update_behind():
    """The first two batches are the untrained policy's; by turns, each is of the newest."""

    def scales(ahead: bool) -> list[float]:
        made = trainer(f"collector.ahead={ahead}", "ppo.total_frames=144", "ppo.learning_rate=0.1", "ppo.minibatch=9")
        found = []
        with collecting(made.next_batch):
            for _ in range(4):
                batch = made.collect()[0]
                found.append(float(batch["scale"][0, 0, 0]))
                made.algorithm.update(batch)
                made.frames += batch.numel()
        return found

    by_turns, ahead = scales(False), scales(True)
    assert by_turns[0] == ahead[0] == ahead[1] != by_turns[1]
    assert len(set(by_turns)) == 4
    assert len(set(ahead)) == 3
