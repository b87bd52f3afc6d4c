"""Videos are made where the machine can render; elsewhere a training says so once and goes on."""

from __future__ import annotations

import io

import pytest
import torch
from PIL import Image
from tensordict import TensorDict

from forcegrasp.config import GraspConfig, TrainConfig
from forcegrasp.controllers import make_controller
from forcegrasp.env import build_env
from forcegrasp.evaluate.video import HEIGHT, WIDTH, NoRendererError, grasp_video
from forcegrasp.runs.run_dir import RunDir
from forcegrasp.train.loop import train


@pytest.fixture(scope="module")
def episode() -> TensorDict:
    env = build_env(1, grasp=GraspConfig(steps=31, radius_m=[0.033, 0.033]), seed=3)
    with torch.no_grad():
        return env.rollout(31, make_controller("close"))[0]


def test_video_or_a_reason(episode, monkeypatch):
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    try:
        data = grasp_video(episode, "reference", every=4)
    except NoRendererError:
        return
    with Image.open(io.BytesIO(data)) as video:
        assert (video.format, video.size, video.n_frames) == ("GIF", (2 * WIDTH, HEIGHT), 8)
        first = video.convert("L").crop((0, 0, WIDTH, HEIGHT)).tobytes()
        video.seek(video.n_frames - 1)
        last = video.convert("L").crop((0, 0, WIDTH, HEIGHT)).tobytes()
    assert len(set(first)) > 5, "the scene must not be blank"
    assert first != last, "the fingers must move"


def test_no_renderer(episode, monkeypatch):
    monkeypatch.setenv("MUJOCO_GL", "nonsense")
    with pytest.raises(NoRendererError, match="install") as caught:
        grasp_video(episode, "reference")
    assert "\n" not in str(caught.value)


def test_training_goes_on_without_a_renderer(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("MUJOCO_GL", "nonsense")
    config = TrainConfig()
    config.ppo.total_frames, config.ppo.grasps, config.grasp.steps, config.ppo.hidden = 6, 2, 3, [4]
    config.log.video_every, config.log.figures_every, config.log.histograms_every = 1, 0, 0
    run = RunDir.create(tmp_path / "run", config, [])
    assert train(config, run)
    assert run.load()[1]["frames"] == 6
    assert capsys.readouterr().err.count("no video") == 1
    assert not list(run.figures.iterdir())
