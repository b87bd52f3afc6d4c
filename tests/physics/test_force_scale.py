"""Sizes of effects follow the forces of a servo or a gripper, where its description does not say otherwise."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from forcegrasp.effects.for_gripper import effect_of
from forcegrasp.physics import load_gripper
from forcegrasp.physics.gripper import shipped_folder

SCENE = """<mujoco><worldbody><body><joint name="elbow" type="hinge"/><geom size="0.02" mass="0.1"/></body></worldbody>
<actuator><position name="servo" joint="elbow" kp="20" {limit}/></actuator></mujoco>"""
DESCRIPTION = """format: forcegrasp-mechanism/1
name: arm
model: arm.xml
motors: [{joint: elbow, actuator: servo, span: 1.0}]
period_s: 0.02
parameters:
  position_gain: {nominal: 20, low: 2, high: 200, unit: N·m/rad, scope: gripper, writes: [actuator_gainprm 0]}
"""


@pytest.mark.parametrize(
    ("limit", "said", "largest"),
    [('forcerange="-8 8"', "", 8.0), ("", "", 1.0), ('forcerange="-8 8"', "scale: {force: 3}\n", 3.0)],
)
def test_friction_is_looked_for_up_to_half_of_the_largest_effort(tmp_path: Path, limit, said, largest):
    (tmp_path / "arm.xml").write_text(SCENE.format(limit=limit), "utf-8")
    (tmp_path / "arm.yaml").write_text(DESCRIPTION + said, "utf-8")
    arm = load_gripper(str(tmp_path / "arm.yaml"))
    assert arm.force_scale == largest
    assert effect_of("coulomb_friction", arm).parameters[0].high == pytest.approx(0.5 * largest)


@pytest.mark.parametrize(("training", "force_n"), [("", 10.0), ("training: {max_force_n: 25}\n", 50.0)])
def test_a_gripper_that_does_not_say_is_looked_at_by_what_it_presses_with(tmp_path: Path, training, force_n):
    shipped = shipped_folder() / "franka_hand.yaml"
    content = yaml.safe_load(shipped.read_text("utf-8"))
    kept = {key: value for key, value in content.items() if key not in ("scale", "training")}
    (tmp_path / "hand.yaml").write_text(yaml.safe_dump(kept, allow_unicode=True) + training, "utf-8")
    (tmp_path / "franka_hand.xml").write_text(shipped.with_suffix(".xml").read_text("utf-8"), "utf-8")
    hand = load_gripper(str(tmp_path / "hand.yaml"))
    assert hand.force_scale == pytest.approx(force_n)
    one_motor_moves_two_fingers = 2
    high = effect_of("coulomb_friction", hand).parameters[0].high
    assert high == pytest.approx(0.5 * force_n * one_motor_moves_two_fingers)
