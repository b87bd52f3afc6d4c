"""Videos are made where the machine can render; elsewhere a training says so once and goes on."""

from __future__ import annotations

import io
import tempfile
from pathlib import Path

import numpy as np
import pytest
import torch
from PIL import Image
from tensordict import TensorDict

from forcegrasp.cli.main import main
from forcegrasp.config import GraspConfig, SensorConfig, TrainConfig
from forcegrasp.controllers import make_controller
from forcegrasp.env import build_env
from forcegrasp.env.episodes import summarise
from forcegrasp.evaluate.grasp_figure import draw_grasp, draw_grasps, from_the_start
from forcegrasp.evaluate.grasp_layout import (
    BOTTOM_EDGE,
    HEIGHT,
    LEFT_EDGE,
    RIGHT_EDGE,
    SCENE_HEIGHT,
    SCENE_WIDTH,
    TOP_EDGE,
    WIDTH,
)
from forcegrasp.evaluate.video import _mp4, grasp_video
from forcegrasp.physics import default_gripper
from forcegrasp.physics.completion import complete
from forcegrasp.physics.scene_renderer import NoRendererError
from forcegrasp.runs.run_dir import RunDir
from forcegrasp.train.loop import train

SENSORS = complete(SensorConfig(), default_gripper())


@pytest.fixture(scope="module")
def episode() -> TensorDict:
    env = build_env(1, grasp=GraspConfig(steps=31, radius_m=[0.033, 0.033]), seed=3)
    with torch.no_grad():
        return env.rollout(31, make_controller("close"))[0]


def test_video_or_a_reason(episode, monkeypatch):
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    try:
        data = grasp_video({"close": episode, "again": episode}, SENSORS, every=6)
    except NoRendererError:
        return
    pictures = []
    with Image.open(io.BytesIO(data)) as video:
        # steps 0, 6, ... 30, and the last
        assert (video.format, video.size, video.n_frames) == ("GIF", (WIDTH, 2 * HEIGHT), 7)
        for number in (0, 2, 6):
            video.seek(number)
            pictures.append(np.asarray(video.convert("RGB")).astype(int))
    scenes = [picture[HEIGHT - SCENE_HEIGHT : HEIGHT, :SCENE_WIDTH] for picture in pictures]
    assert len(np.unique(scenes[0].reshape(-1, 3), axis=0)) > 20, "the scene must not be blank"
    assert (scenes[0] != scenes[2]).any(), "the fingers must move"
    for picture, scene in zip(pictures, scenes, strict=True):  # the same grasp twice
        assert (picture[2 * HEIGHT - SCENE_HEIGHT :, :SCENE_WIDTH] == scene).all()
    # what is ahead is faded: until half of the episode is over, there is less ink in the second half of the chart
    half = slice((LEFT_EDGE + RIGHT_EDGE) // 2 + 20, RIGHT_EDGE)
    ink = [(255 - picture[TOP_EDGE:BOTTOM_EDGE, half]).sum() for picture in pictures]
    assert ink[0] == pytest.approx(ink[1], rel=0.2)
    assert ink[1] < 0.5 * ink[2]


def test_scene_is_where_the_grasp_was(episode):
    """Nothing is simulated again, so the positions are those of the episode, whatever model it came from."""
    positions = from_the_start(episode, "joint_position")
    assert positions.shape == (32, 2)
    np.testing.assert_array_equal(positions[0], episode["joint_position"][0])
    np.testing.assert_array_equal(positions[-1], episode["next", "joint_position"][-1])


def test_phases_are_marked_when_they_happened(episode):
    figure = draw_grasp(episode, "close", SENSORS, "#0072b2")
    forces, moved = figure.axes
    seconds = summarise(episode[None], SENSORS)
    assert float(seconds["both_contact_s"]) < 31 * 0.04
    for axes in (forces, moved):
        marks = {line.get_xdata()[0] for line in axes.lines if line.get_linestyle() == ":"}
        assert marks == {float(seconds["first_contact_s"][0]), float(seconds["both_contact_s"][0])}
    goal = float(episode["goal_force"][0])
    (band,) = forces.patches
    assert band.get_y() == pytest.approx(goal - 2 * SENSORS.force_std_n)
    assert band.get_height() == pytest.approx(4 * SENSORS.force_std_n)
    drawn = next(line for line in forces.lines if line.get_label() == "right")
    np.testing.assert_array_equal(drawn.get_ydata()[1:], episode["next", "force"][:, 1])
    moves = (episode["next", "object_position"][:, 0] - episode["object_position"][0, 0]) * 1e3
    np.testing.assert_allclose(moved.lines[0].get_ydata()[1:], moves, atol=1e-4)


def test_pictures_of_several_policies_have_the_same_scales(episode):
    env = build_env(1, grasp=GraspConfig(steps=31, radius_m=[0.033, 0.033]), seed=3)
    with torch.no_grad():
        other = env.rollout(31, make_controller("nothing"))[0]
    one, two = draw_grasps({"close": episode, "nothing": other}, SENSORS)
    alone = draw_grasp(episode, "close", SENSORS, "#0072b2")
    for axes, same, own in zip(one.axes, two.axes, alone.axes, strict=True):
        assert axes.get_ylim() == same.get_ylim()
        assert axes.get_ylim()[1] >= own.get_ylim()[1]


@pytest.mark.parametrize(
    ("asked", "told"), [("broken", "with MUJOCO_GL=broken; unset MUJOCO_GL"), (None, "install libegl1 or libosmesa6")]
)
def test_no_renderer(asked, told, episode, monkeypatch):
    """Who named a renderer that is none is not sent to install a library."""
    monkeypatch.setattr("forcegrasp.physics.scene_renderer.backends", lambda: ("broken",))
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    if asked:
        monkeypatch.setenv("MUJOCO_GL", asked)
    with pytest.raises(NoRendererError, match=told) as caught:
        grasp_video({"close": episode}, SENSORS)
    assert "\n" not in str(caught.value)
    assert ("install" in str(caught.value)) == (asked is None)


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


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # its reader leaves pipes open
def test_mp4_has_the_same_pictures_and_lasts_as_long():
    ffmpeg = pytest.importorskip("imageio_ffmpeg")
    pictures = [np.full((51, 64, 3), shade, np.uint8) for shade in (40, 120, 200)]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "film.mp4"
        path.write_bytes(_mp4(pictures, 0.5))
        frames = ffmpeg.read_frames(path)
        facts = next(frames)
        shades = [np.frombuffer(frame, np.uint8).mean() for frame in frames]
    assert (facts["codec"], facts["size"], facts["fps"]) == ("h264", (64, 50), 2.0)
    np.testing.assert_allclose(shades, [40, 120, 200, 200, 200], atol=3)


def test_mp4_without_its_package_is_told_in_a_line(monkeypatch, capsys, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("forcegrasp.cli.render.find_spec", lambda name: None)
    assert main(["render", "out=grasp.mp4"]) == 2
    told = "out=grasp.mp4: needs imageio-ffmpeg: pip install 'forcegrasp[video]'; or name a .gif"
    assert told in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_the_files_name_is_the_format(monkeypatch, tmp_path):
    asked = []
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("forcegrasp.cli.render.find_spec", lambda name: name)
    monkeypatch.setattr("forcegrasp.evaluate.render.grasp_video", lambda *_, mp4, **__: asked.append(mp4) or b"")
    for name in ("grasp.mp4", "grasp.gif"):
        assert main(["render", "steps=2", "physics=fast", f"out={name}"]) == 0
    assert asked == [True, False]
