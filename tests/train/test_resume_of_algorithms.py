"""Every learning algorithm goes on from a checkpoint exactly as if it had not been interrupted."""

from __future__ import annotations

import shutil

import pytest
import torch

from forcegrasp.runs.run_dir import RunDir
from forcegrasp.train.algorithms import algorithm_of
from forcegrasp.train.loop import train

SAC = {"total_frames": 300, "grasps": 2, "hidden": [8], "buffer": 130, "updates": 3, "minibatch": 16}
CASES = {
    "recurrent PPO": {"ppo": {"memory": 4, "minibatch": 60}},
    "recurrent PPO, taught, not mirrored": {"ppo": {"memory": 4, "mirrored": False, "teacher_weight": 1.0}},
    "SAC": {"sac": SAC},
    "SAC with little": {"sac": SAC | {"critic": "observation", "buffer": 7}, "observation": {"frames": 1}},
}


@pytest.mark.parametrize("name", CASES)
def test_resumed_run_equals_the_uninterrupted_one(name, tiny, trained, metrics, tmp_path):
    config = tiny(log={"checkpoint_every": 2, "keep": 99}, **CASES[name])
    config.learner = "sac" if "SAC" in name else "ppo"
    whole = trained(tmp_path / "whole", config)
    first, second, last = sorted(path.name for path in whole.checkpoints.glob("frames_*"))
    run = RunDir.create(tmp_path / "run", config, [])
    run.checkpoints.mkdir(exist_ok=True)
    shutil.copy(whole.checkpoints / second, run.checkpoints)
    shutil.copy(whole.metrics_path, run.metrics_path)
    torch.manual_seed(12345)  # what a new process would have, or not
    assert train(run.config(), run, resume=True)
    assert (run.checkpoints / last).read_bytes() == (whole.checkpoints / last).read_bytes()
    assert (run.checkpoints / last).read_bytes() != (whole.checkpoints / first).read_bytes()
    assert metrics(run) == metrics(whole)
    drawn = [column for page in algorithm_of(config).CHARTS.values() for chart in page.values() for column in chart]
    assert set(drawn) <= set(metrics(run)[0])
