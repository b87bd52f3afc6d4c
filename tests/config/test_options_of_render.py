"""Every option of render changes something: another grasp is shown, or other words are said."""

from __future__ import annotations

import contextlib
import io
from pathlib import Path
from typing import Any

import pytest

from forcegrasp.cli.main import main
from forcegrasp.cli.options import leaves
from forcegrasp.config import RenderConfig
from tests.config.tiny_runs import ELSEWHERE, MODEL, threads_asked

#: It wants a display: tests/evaluate/test_live.py.
LIVE = ("live",)

#: Option → another value than in a rendering of 45 steps of a policy that reads everything.
RENDER_CASES: dict[str, Any] = {
    "policies": "[informed]",
    "out": "elsewhere.gif",
    "live": True,
    "gripper": "franka_hand",
    "seed": 1,
    "kappa": 0.1,
    "b2": -6.5,
    "radius_m": 0.03,
    "offset_m": 0.003,
    "goal_force_n": 0.1,
    "steps": 44,
    "model": str(MODEL),
    "physics.tier": "reference",
    "physics.threads": 2,
    "physics.engine": "warp",
    "physics.device": "cuda",
    "sensors.position_std_m": 0.001,
    "sensors.force_std_n": 0.1,
    "sensors.contact_threshold_n": 0.2,
}


def test_every_option_of_render_has_a_case():
    assert list(RENDER_CASES) == [name for name, *_ in leaves(RenderConfig)]


def rendered(folder: Path, **values: Any) -> tuple:
    """What would be shown, what is said, where it is written, and with how many threads it was simulated."""
    shown, said = [], io.StringIO()

    def show(episodes, sensors, gripper, mp4):
        shown.extend(episode["next", "force"].tolist() for episode in episodes.values())
        return b"GIF"

    tiny = {"steps": 45, "physics": "fast", "physics.threads": 1, "out": "plain.gif"}
    with pytest.MonkeyPatch.context() as patch, contextlib.redirect_stdout(said), threads_asked() as threads:
        patch.chdir(folder)
        patch.setattr("forcegrasp.evaluate.render.grasp_video", show)
        assert main(["render", *(f"{name}={value}" for name, value in (tiny | values).items())]) == 0
    return shown, threads, said.getvalue()


@pytest.fixture(scope="module")
def plain_rendering(tmp_path_factory, plain_training, run_path):
    return rendered(tmp_path_factory.mktemp("render"), policies=[str(run_path)])


def test_the_same_rendering_shows_the_same(tmp_path, plain_rendering, run_path):
    assert rendered(tmp_path, policies=[str(run_path)]) == plain_rendering


@pytest.mark.parametrize("name", [name for name in RENDER_CASES if name not in ("gripper", *LIVE, *ELSEWHERE)])
def test_option_of_render(name, tmp_path, plain_rendering, run_path):
    assert rendered(tmp_path, **{"policies": [str(run_path)], name: RENDER_CASES[name]}) != plain_rendering


def test_gripper_of_render_is_the_one_that_grasps(tmp_path):
    plain, other = (rendered(tmp_path, policies="close", **more) for more in ({}, {"gripper": RENDER_CASES["gripper"]}))
    assert plain[0] != other[0]
