"""The known grasp is the golden one; what differs, fails, or can't be rendered is told."""

from __future__ import annotations

import json
import runpy

import numpy as np
import pytest

from forcegrasp.doctor import physics
from forcegrasp.doctor.child import Child
from forcegrasp.doctor.physics import KNOWN, check_physics, check_renderer


def answers(monkeypatch, output: str = "", failure: str = "") -> list[dict[str, str]]:
    """Lets every child give this answer; returns the variables that they are given."""
    asked = []

    def run_python(*arguments: str, **environment: str) -> Child:
        asked.append(environment)
        return Child(output, failure)

    monkeypatch.setattr(physics, "run_python", run_python)
    return asked


def test_the_known_grasp_is_the_golden_one(root):
    tool = runpy.run_path(str(root / "tools" / "golden.py"))
    for tier, (positions, forces) in KNOWN.items():
        first = tool["read"](tier)
        end = first[(first[:, 0] == 0) & (first[:, 1] == 119)][0]
        np.testing.assert_allclose(end[2:4], positions, atol=1e-9)
        np.testing.assert_allclose(end[4:6], forces, atol=1e-6)


def test_this_machine_computes_it(told):
    assert "1.5" in told(check_physics, "fine")


@pytest.mark.parametrize("tier", KNOWN)
@pytest.mark.parametrize(
    ("which", "change", "unit"),
    [(0, 3e-6, "m"), (0, -3e-6, "m"), (1, 0.04, "N"), (1, -0.04, "N"), (1, float("nan"), "N")],
)
def test_another_end(tier, which, change, unit, told, monkeypatch):
    ends = json.loads(json.dumps(KNOWN))
    ends[tier][which][1] += change
    answers(monkeypatch, json.dumps(ends))
    line = told(check_physics, "mend")
    assert f"{tier}: " in line
    assert f" {unit} instead of " in line
    assert "fresh environment" in line


def test_no_physics(told, monkeypatch):
    answers(monkeypatch, failure="ImportError: no MuJoCo")
    assert "can't be simulated (ImportError: no MuJoCo); see what is said of MuJoCo" in told(check_physics, "mend")


def test_renderer(told, monkeypatch):
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    asked = answers(monkeypatch, "rendered\n")
    line = told(check_renderer, "fine")
    assert len(asked) == 1
    assert f"rendered with {asked[0]['MUJOCO_GL']}" in line


def test_no_renderer(told, monkeypatch):
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    monkeypatch.setattr("sys.platform", "linux")
    asked = answers(monkeypatch, failure="the process died of SIGSEGV")
    line = told(check_renderer, "warning")
    assert [environment["MUJOCO_GL"] for environment in asked] == ["egl", "osmesa"]
    assert "(egl, osmesa tried)" in line
    assert "install libegl1 or libosmesa6" in line


def test_the_users_choice_does_not_render(told, monkeypatch):
    monkeypatch.setenv("MUJOCO_GL", "osmesa")
    asked = answers(monkeypatch, failure="no such library")
    assert "(osmesa tried); all else works without; unset MUJOCO_GL" in told(check_renderer, "warning")
    assert asked == [{"MUJOCO_GL": "osmesa"}]


def test_the_user_wants_no_videos(told, monkeypatch):
    monkeypatch.setenv("MUJOCO_GL", "disable")
    assert "none, as MUJOCO_GL=disable asks" in told(check_renderer, "note")
