"""Known grasps are what they were; what differs, fails, or can't be rendered is told."""

from __future__ import annotations

import json
import runpy

import numpy as np
import pytest

from forcegrasp.assets import DEFAULT_GRIPPER
from forcegrasp.doctor import physics
from forcegrasp.doctor.child import Child
from forcegrasp.doctor.known_grasps import TIERS, known_grasps
from forcegrasp.doctor.physics import check_physics, check_renderer
from forcegrasp.physics import shipped_grippers

KNOWN = known_grasps()


def answers(monkeypatch, output: str = "", failure: str = "") -> list[dict[str, str]]:
    """Lets every child give this answer; returns the variables that they are given."""
    asked = []

    def run_python(*arguments: str, **environment: str) -> Child:
        asked.append(environment)
        return Child(output, failure)

    monkeypatch.setattr(physics, "run_python", run_python)
    return asked


def test_the_paper_grippers_grasp_is_the_golden_one(root):
    tool = runpy.run_path(str(root / "tools" / "golden.py"))
    for tier in TIERS:
        positions, forces = KNOWN[DEFAULT_GRIPPER][tier]
        first = tool["read"](tier)
        end = first[(first[:, 0] == 0) & (first[:, 1] == 119)][0]
        np.testing.assert_allclose(end[2:4], positions, atol=1e-9)
        np.testing.assert_allclose(end[4:6], forces, atol=1e-6)


def test_every_gripper_holds_its_object():
    assert sorted(KNOWN) == shipped_grippers()
    assert all(min(KNOWN[name][tier][1]) > 1 for name in KNOWN for tier in TIERS)


def test_this_machine_computes_them(told):
    line = told(check_physics, "fine")
    assert all(f"{name} with " in line for name in KNOWN)


@pytest.mark.parametrize("name", KNOWN)
@pytest.mark.parametrize("tier", TIERS)
@pytest.mark.parametrize(("which", "change"), [(0, 2e-4), (0, -2e-4), (1, 0.04), (1, -0.04), (1, float("nan"))])
def test_another_end(name, tier, which, change, told, monkeypatch):
    found = json.loads(json.dumps(KNOWN))
    found[name][tier][which][-1] *= 1 + change * (1 if which == 0 else 1 / found[name][tier][which][-1])
    answers(monkeypatch, json.dumps(found))
    line = told(check_physics, "mend")
    unit = KNOWN[name]["unit"] if which == 0 else "N"
    assert f"{name}, {tier}: " in line
    assert f" {unit} instead of " in line
    assert "fresh environment" in line


def test_no_physics(told, monkeypatch):
    first, second = sorted(KNOWN)[:2]
    answers(monkeypatch, f'{{"{first}": {{}}', failure="ImportError: no MuJoCo")
    told_of = f"can't be simulated (ImportError: no MuJoCo, with {second}); see what is said of MuJoCo"
    assert told_of in told(check_physics, "mend")


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
