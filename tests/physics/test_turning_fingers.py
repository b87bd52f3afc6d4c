"""Fingers that turn, each on a motor of its own: where their pads stand follows from where their own motor does."""

from __future__ import annotations

import numpy as np
import pytest

from forcegrasp.effects.for_gripper import effects_of
from forcegrasp.physics import load_gripper

SCENE = """<mujoco model="tongs">
  <compiler angle="radian"/>
  <option timestep="0.002" integrator="implicitfast" gravity="0 0 0"/>
  <default>
    <joint type="hinge" range="-0.1 0.6" armature="0.002" damping="0.1"/>
    <position kp="20" kv="0.5" ctrlrange="0 0.5"/>
  </default>
  <worldbody>
    <body name="object">
      <joint name="object" type="slide" axis="1 0 0"/>
      <geom name="object" type="cylinder" size="0.02 0.03" mass="0.1" priority="1" solref="0.02 1"/>
    </body>
    <body name="left" pos="-0.01 -0.1 0">
      <joint name="left" axis="0 0 1"/>
      <geom type="sphere" pos="0 0.1 0" size="0.01" mass="0.02"/>
    </body>
    <body name="right" pos="0.01 -0.1 0">
      <joint name="right" axis="0 0 -1"/>
      <geom type="sphere" pos="0 LENGTH 0" size="0.01" mass="0.02"/>
    </body>
  </worldbody>
  <contact><exclude body1="left" body2="right"/></contact>
  <actuator><position name="left" joint="left"/><position name="right" joint="right"/></actuator>
  <sensor>
    <contact name="left" body1="object" body2="left" num="4" data="force"/>
    <contact name="right" body1="object" body2="right" num="4" data="force"/>
  </sensor>
  <keyframe><key qpos="0 0.5 0.5" ctrl="0.5 0.5"/></keyframe>
</mujoco>"""
DESCRIPTION = """format: forcegrasp-gripper/2
name: tongs
model: tongs.xml
motors:
  - {joint: left, actuator: left, closed: 0.0, open: 0.5}
  - {joint: right, actuator: right, closed: 0.0, open: 0.5}
fingers:
  left: {joint: left, force_sensor: left}
  right: {joint: right, force_sensor: right}
object: {joint: object, geom: object, axis: x}
control: {period_s: 0.02, max_step: 0.02}
parameters:
  position_gain:
    {nominal: 20, low: 5, high: 80, unit: N·m/rad, scope: gripper, writes: [actuator_gainprm 0, -actuator_biasprm 1]}
  force_scale: {nominal: 1.0, low: 0.5, high: 2, unit: "1", scope: gripper, writes: []}
  radius_m: {nominal: 0.02, low: 0.005, high: 0.04, unit: m, scope: object, writes: []}
  offset_m: {nominal: 0.0, low: -0.01, high: 0.01, unit: m, scope: grasp, writes: []}
"""


@pytest.mark.parametrize("joint", ["slide", "free"])
def test_a_contact_that_does_not_rub_is_for_objects_that_turning_pads_can_not_lose(tmp_path, joint):
    free = '<freejoint name="object"/>'
    scene = SCENE.replace("LENGTH", "0.1").replace(
        'qpos="0 0.5', 'qpos="0 0 0 1 0 0 0 0.5' if joint == "free" else 'qpos="0 0.5'
    )
    if joint == "free":
        scene = scene.replace('<joint name="object" type="slide" axis="1 0 0"/>', free)
    (tmp_path / "tongs.xml").write_text(scene)
    (tmp_path / "tongs.yaml").write_text(DESCRIPTION)
    gripper = load_gripper(str(tmp_path / "tongs.yaml"))
    assert not gripper.pads_stay_parallel
    assert ("hunt_crossley_contact" in effects_of(gripper)) is (joint == "slide")


@pytest.mark.parametrize(("right_length", "alike"), [(0.1, True), (0.13, False)])
def test_pads_stand_where_their_own_motors_put_them_if_both_sides_are_alike(tmp_path, right_length, alike):
    (tmp_path / "tongs.xml").write_text(SCENE.replace("LENGTH", str(right_length)))
    (tmp_path / "tongs.yaml").write_text(DESCRIPTION)
    gripper = load_gripper(str(tmp_path / "tongs.yaml"))
    angle = np.array([[0.2, 0.4], [0.45, 0.1]])
    pads = gripper.pads_at(angle)
    if not alike:
        assert pads is None
        return
    # a pad of 10 mm radius on a finger of 100 mm, whose pivot is 10 mm from the middle
    np.testing.assert_allclose(pads, 0.1 * np.sin(angle), atol=2e-5)
