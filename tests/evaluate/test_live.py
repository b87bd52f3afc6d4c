"""``render live=true``: the viewer follows the simulation step by step; without a display a line says so."""

from __future__ import annotations

import contextlib
from pathlib import Path

import mujoco.viewer
import numpy as np
import pytest

from forcegrasp.cli.main import main

TINY = ["render", "live=true", "physics=fast", "physics.threads=1", "steps=12"]


class Viewer:
    """As much of MuJoCo's as is used; its window is closed at the second look."""

    def __init__(self, model, data, **_) -> None:
        self.data, self.seen, self.looks, self.lock = data, [], 0, contextlib.nullcontext

    def sync(self) -> None:
        self.seen.append(self.data.qpos.copy())

    def is_running(self) -> bool:
        self.looks += 1
        return self.looks < 2

    def close(self) -> None:
        self.looks = -1


@pytest.fixture
def viewers(monkeypatch, tmp_path) -> list[Viewer]:
    opened = []
    monkeypatch.setattr(mujoco.viewer.glfw, "init", lambda: True)
    monkeypatch.setattr(mujoco.viewer, "launch_passive", lambda *a, **k: opened.append(Viewer(*a, **k)) or opened[-1])
    monkeypatch.setattr("forcegrasp.evaluate.live.time.sleep", lambda seconds: None)
    monkeypatch.chdir(tmp_path)
    return opened


def test_the_viewer_shows_every_step_and_no_video_is_written(viewers, capsys):
    assert main([*TINY, "policies=[close,nothing]"]) == 0
    (viewer,) = viewers
    close, nothing = np.array(viewer.seen[:12]), np.array(viewer.seen[12:])
    assert len(close) == len(nothing) == 12
    assert (np.diff(close[:, -1]) < 0).any(), "the fingers close"
    assert np.ptp(nothing[:, -1]) < 1e-3
    assert viewer.looks == -1, "closed"
    assert not list(Path().rglob("*.*"))
    assert "close: force reward" in capsys.readouterr().out


def test_a_video_is_written_besides_if_it_is_named(viewers, monkeypatch):
    monkeypatch.setattr("forcegrasp.evaluate.render.grasp_video", lambda *args, **options: b"GIF")
    assert main([*TINY, "out=grasp.gif"]) == 0
    assert len(viewers) == 1
    assert Path("grasp.gif").read_bytes() == b"GIF"


def test_without_a_display_a_line_says_what_to_do(monkeypatch, capsys, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(mujoco.viewer.glfw, "init", lambda: False)
    assert main(TINY) == 2
    told = capsys.readouterr().err
    assert "live=true: no display here" in told
    assert "write a video instead: out=NAME.gif" in told
    assert told.count("\n") == 1
