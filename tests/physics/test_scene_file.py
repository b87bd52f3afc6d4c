"""Scenes that would have MuJoCo wait, or ask for more memory than there is, are refused before it reads them."""

from __future__ import annotations

import os

import pytest

from forcegrasp.errors import ConfigError
from forcegrasp.physics.gripper import shipped_folder
from forcegrasp.physics.gripper_file import load_gripper
from forcegrasp.physics.scene_file import check_scene


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("<replicate count='1000000000'><geom size='1'/></replicate>", "copies"),
        ("<replicate count='100'><replicate count='100'><geom size='1'/></replicate></replicate>", "copies"),
        ("<flexcomp count='1000 1000 1000'/>", "copies"),
        ("<replicate count='x'/>", "copies"),
        ("<hfield nrow='100000' ncol='100000'/>", "numbers"),
        ("<texture width='1000000' height='1000000'/>", "numbers"),
        ("<size nuser_geom='1000000000'/>", "numbers"),
        ("<include file='scene.xml'/>", "includes itself"),
        ("<include file='nowhere.xml'/>", "could not read"),
        ("<include file='pipe'/>", "not an ordinary file"),
        ("<mesh file='pipe'/>", "ordinary file"),
        ("<mesh file='/dev/zero'/>", "ordinary file"),
        ("<geom>", "not XML"),
    ],
)
def test_refused(tmp_path, text, told):
    scene = tmp_path / "scene.xml"
    scene.write_text(f"<mujoco>{text}</mujoco>")
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(ConfigError, match=told) as caught:
        check_scene(scene)
    assert str(tmp_path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_entities_are_refused(tmp_path):
    (tmp_path / "scene.xml").write_text("<!DOCTYPE x [<!ENTITY a 'b'>]><mujoco model='&a;'/>")
    with pytest.raises(ConfigError, match="entities"):
        check_scene(tmp_path / "scene.xml")


def test_what_scenes_do_is_allowed(tmp_path):
    (tmp_path / "part.xml").write_text("<mujoco><asset><mesh file='m.stl'/></asset></mujoco>")
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "m.stl").write_bytes(b"x")
    inner = "<compiler meshdir='meshes'/><include file='part.xml'/><replicate count='10'><geom size='1'/></replicate>"
    (tmp_path / "scene.xml").write_text(f"<mujoco>{inner}</mujoco>")
    check_scene(tmp_path / "scene.xml")


@pytest.mark.parametrize("step", ["nan", "0", "1"])
def test_steps_that_never_end_are_refused(tmp_path, step):
    text = (shipped_folder() / "tiago.xml").read_text()
    (tmp_path / "tiago.xml").write_text(text.replace("<worldbody>", f"<option timestep='{step}'/>\n<worldbody>", 1))
    (tmp_path / "x.yaml").write_bytes((shipped_folder() / "tiago.yaml").read_bytes())
    with pytest.raises(ConfigError, match="timestep"):
        load_gripper("./x.yaml", tmp_path)
