"""A training that begins with the networks of another one: what it takes over, what it doesn't, and what is refused."""

from __future__ import annotations

import shutil

import pytest
import torch

from forcegrasp.cli.main import main
from forcegrasp.errors import CheckpointError, ConfigError
from forcegrasp.runs import checkpoint
from forcegrasp.runs.run_dir import RunDir
from forcegrasp.train.loop import Trainer, train
from forcegrasp.train.warm_start import read_start

SAC = {"total_frames": 120, "grasps": 2, "hidden": [8], "buffer": 130, "updates": 3, "minibatch": 16}
CASES = {
    "PPO": {"ppo": {"total_frames": 120}},
    "recurrent PPO": {"ppo": {"memory": 4, "minibatch": 60, "total_frames": 120}},
    "SAC": {"sac": SAC},
}
DEVIATION = "state_independent_scale"


@pytest.mark.parametrize("name", CASES)
def test_networks_are_taken_over_and_nothing_else(name, tiny, trained, tmp_path):
    config = tiny(**CASES[name])
    config.learner = "sac" if name == "SAC" else "ppo"
    before, _ = trained(tmp_path / "first", config).load()
    config.start, config.algorithm.log_std, config.seed = str(tmp_path / "first"), -3.0, 5
    learner = Trainer(config).algorithm
    fresh = learner.state_dict()
    learner.begin_with(read_start(config))
    for key, value in learner.state_dict().items():
        network = key.startswith(("policy.", "value.", "loss.qvalue", "loss.target_qvalue"))
        expected = before if network and not key.endswith(DEVIATION) else fresh
        assert torch.equal(value, expected[key]), key
        assert key in before
    assert not any(key.startswith("optimizer") for key in learner.state_dict())
    assert learner.state_dict().keys() < before.keys()
    deviation = next(v for k, v in learner.state_dict().items() if k.endswith(DEVIATION))
    assert deviation.tolist() == [-3.0, -3.0]


def test_a_value_network_of_another_shape_begins_anew(tiny, trained, tmp_path):
    trained(tmp_path / "first", tiny(ppo={"total_frames": 60, "critic": "observation"}))
    config = tiny(ppo={"total_frames": 60})
    config.start = str(tmp_path / "first")
    learner = Trainer(config).algorithm
    fresh = {k: v.clone() for k, v in learner.state_dict().items()}
    learner.begin_with(read_start(config))
    changed = {key for key, value in learner.state_dict().items() if not torch.equal(value, fresh[key])}
    assert "value.module.net.0.weight" in fresh.keys() - changed
    assert "policy.module.0.module.0.net.0.weight" in changed


def test_a_training_begins_with_them(tiny, trained, tmp_path):
    """With a learning rate of 0 it also ends with them; its own checkpoint is then all that resuming needs."""
    first = trained(tmp_path / "first", tiny())
    config = tiny(ppo={"learning_rate": 0.0}, log={"checkpoint_every": 1, "keep": 9})
    config.start, config.seed = str(first.path), 3
    second = trained(tmp_path / "second", config)
    one, other = (run.load()[0] for run in (first, second))
    policy = [name for name in one if name.startswith("policy.") and not name.endswith(DEVIATION)]
    assert len(policy) == 4
    for name in policy:
        assert torch.equal(one[name], other[name])
    shutil.rmtree(first.path)
    last = max(second.checkpoints.glob("frames_*"))
    expected = last.read_bytes()
    last.unlink()
    (second.checkpoints / "best.safetensors").unlink(missing_ok=True)
    assert train(second.config(), second, resume=True)
    assert last.read_bytes() == expected


OTHER = {
    "observation.frames": ({"observation": {"frames": 2}}, "observation.frames=2"),
    "observation.parts": ({"observation": {"parts": ["position", "force"]}}, "observation.parts=[position,force]"),
    "hidden": ({"ppo": {"hidden": [8, 4]}}, "ppo.hidden=[8,4]"),
    "memory": ({"ppo": {"memory": 4, "minibatch": 60}}, "ppo.memory=4"),
    "mirrored": ({"ppo": {"mirrored": False}}, "ppo.mirrored=False"),
    "squeeze_together": ({"ppo": {"squeeze_together": True}}, "ppo.squeeze_together=True"),
    "gripper": ({"gripper": "franka_hand"}, "gripper=franka_hand"),
    "two": ({"ppo": {"hidden": [4]}, "observation": {"frames": 1}}, "observation.frames=1 ppo.hidden=[4]"),
}


@pytest.mark.parametrize("name", OTHER)
def test_another_network_is_refused_and_what_to_add_is_said(name, tiny, tmp_path):
    different, said = OTHER[name]
    run = RunDir.create(tmp_path / "other", tiny(**different), [])
    checkpoint.write(run.checkpoints / "frames_000000000001.safetensors", {}, {"frames": 1, "config": run.fingerprint})
    config = tiny()
    config.start = str(run.path)
    with pytest.raises(ConfigError) as refused:
        read_start(config)
    assert str(refused.value) == f"start={run.path}: was trained with {said}; add that, or start elsewhere"


def test_another_learner_is_refused(tiny, trained, tmp_path):
    config = tiny(sac=SAC)
    config.learner = "sac"
    trained(tmp_path / "sac", config)
    config = tiny()
    config.start = str(tmp_path / "sac")
    with pytest.raises(ConfigError, match=r"was trained with learner=sac sac\.hidden="):
        read_start(config)


def test_weights_that_are_not_those_of_the_configuration_are_refused(tiny):
    learner = Trainer(tiny()).algorithm
    with pytest.raises(CheckpointError, match=r"its weights do not fit its config\.yaml"):
        learner.begin_with({"policy.module.0.module.0.net.0.weight": torch.zeros(3, 3)})


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["start=nowhere"], "nowhere: no such run directory"),
        (["start=recommended"], "start=recommended: was trained with observation.frames=10 ppo.hidden=[100,100]"),
    ],
)
def test_a_wrong_start_is_refused_before_anything_is_written(arguments, said, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["train", *arguments, "hydra.run.dir=run"]) == 2
    assert said in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
