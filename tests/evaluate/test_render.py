"""A rendered grasp is the one that was asked for, with the same sensors and model for every policy."""

from __future__ import annotations

from pathlib import Path

import pytest

from forcegrasp.cli.main import main
from forcegrasp.physics.scene_renderer import NoRendererError

MODEL = """format: forcegrasp-model/1
gripper: tiago
base:
  position_gain: {value: 80.0, low: 70.0, high: 90.0, unit: N/m}
  velocity_gain: {value: -9.0, low: -10.0, high: -8.0, unit: N·s/m}
effects: {backlash: {gap_m: 0.002}}
"""
QUICK = ["steps=40", "physics=fast", "physics.threads=1", "out=grasp.gif"]


@pytest.fixture
def shown(monkeypatch, tmp_path) -> list[dict]:
    """What would be rendered, call by call."""
    calls = []

    def record(episodes, sensors, **_):
        calls.append(episodes)
        return b"GIF"

    monkeypatch.setattr("forcegrasp.evaluate.render.grasp_video", record)
    monkeypatch.chdir(tmp_path)
    return calls


def test_policies_get_the_same_grasp(shown, capsys):
    grasp = ["kappa=0.25", "radius_m=0.03", "offset_m=-0.004", "goal_force_n=0.4", "b2=-8"]
    assert main(["render", "policies=[force_pi,close]", *grasp, *QUICK]) == 0
    (episodes,) = shown
    assert list(episodes) == ["force_pi", "close"]
    for episode in episodes.values():
        assert episode["grasp_parameters"][0].tolist() == pytest.approx([0.25, -8, 0.03, -0.004, 0.4])
        assert len(episode) == 40
    assert (episodes["force_pi"]["action"] != episodes["close"]["action"]).any()
    assert Path("grasp.gif").read_bytes() == b"GIF"
    out = capsys.readouterr().out
    assert "κ 0.25" in out
    assert "close: force reward" in out
    assert "video: grasp.gif" in out
    assert "in both fingers after" in out


def test_one_policy_by_its_short_name(shown):
    assert main(["render", "policy=close", *QUICK]) == 0
    assert list(shown[0]) == ["close"]


def test_the_model_moves_the_gripper(shown):
    Path("model.yaml").write_text(MODEL)
    assert main(["render", "policy=close", *QUICK]) == 0
    assert main(["render", "policy=close", "model=model.yaml", *QUICK]) == 0
    nominal, effects = (episodes["close"] for episodes in shown)
    assert (nominal["next", "joint_position"] - effects["next", "joint_position"]).abs().max() > 1e-3
    assert -10 <= float(effects["grasp_parameters"][0, 1]) <= -8


def test_without_opengl_a_line_tells_what_to_install(shown, monkeypatch, capsys):
    def missing(*_, **__):
        raise NoRendererError("no OpenGL; install libegl1")

    monkeypatch.setattr("forcegrasp.evaluate.render.grasp_video", missing)
    assert main(["render", *QUICK]) == 2
    out, err = capsys.readouterr()
    assert (out, err) == ("", "forcegrasp: no OpenGL; install libegl1\n")
    assert not Path("grasp.gif").exists()
