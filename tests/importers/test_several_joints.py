"""Recordings of two joints of an arm that move each other: imported, written, read, and their dry friction found."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from forcegrasp.diagnosis.diagnose_set import diagnose_set
from forcegrasp.effects.for_gripper import effects_of
from forcegrasp.errors import ConfigError, MeasurementError
from forcegrasp.identify import loading
from forcegrasp.identify.progress import silent
from forcegrasp.importers.recording import Recording
from forcegrasp.importers.servo_set import as_set
from forcegrasp.measure import write_servo_set
from forcegrasp.physics import load_gripper
from forcegrasp.physics.plant import Plant

ARM = Path(__file__).parents[1] / "mechanisms" / "arm.yaml"
JOINTS = ("shoulder", "elbow")
FRICTION_NM, GAINS, NOISE = 0.15, (18.0, 6.0), 2e-4


def recorded(name: str, speed: float) -> Recording:
    """Simulated by MuJoCo itself, at a quarter of the step: servos of other gains, and dry friction in both joints."""
    model = mujoco.MjModel.from_xml_path(str(ARM.with_suffix(".xml")))
    model.opt.timestep = 0.0005
    model.dof_frictionloss[:] = FRICTION_NM
    for actuator, gain in (("shoulder_servo", GAINS[0]), ("elbow_servo", GAINS[1])):
        model.actuator(actuator).gainprm[0], model.actuator(actuator).biasprm[1] = gain, -gain
    data, time = mujoco.MjData(model), np.arange(0, 4, 0.02)
    command = np.stack([0.5 * np.sin(speed * time), 0.4 * np.sin(1.7 * speed * time + 0.5)], axis=1)
    command *= np.minimum(1, time / 0.5)[:, None]
    position = np.empty_like(command)
    for index, (shoulder, elbow) in enumerate(command):
        position[index] = data.qpos
        data.ctrl[:] = elbow, shoulder  # in the order of the actuators
        mujoco.mj_step(model, data, 40)
    position += NOISE * np.random.default_rng(int(10 * speed)).standard_normal(position.shape)
    return Recording(name, JOINTS, time, command, position)


@pytest.fixture(scope="module")
def runs() -> list[Recording]:
    return [recorded("slow", 1.5), recorded("fast", 3.0)]


@pytest.mark.long
def test_friction_hidden_in_an_arm_is_found(runs, tmp_path):
    loaded = loading.load(write_servo_set(as_set(runs, load_gripper(str(ARM)), "", ""), tmp_path / "set"))
    assert loaded.measured.columns.position == ("q_shoulder_rad", "q_elbow_rad")
    diagnosis, _ = diagnose_set(loaded, None, ["coulomb_friction", "command_deadband"], 0, silent)
    assert diagnosis.preferred == ("coulomb_friction",)
    assert diagnosis.error_after < 2 < 0.05 * diagnosis.error_before
    (friction,) = [one.values for one in diagnosis.fit.problem.case(diagnosis.fit.vector).effects]
    assert friction == pytest.approx([FRICTION_NM], rel=0.05)
    values = dict(zip((e.name for e in diagnosis.fit.problem.entries), diagnosis.fit.values, strict=True))
    assert (values["shoulder_gain"], values["elbow_gain"]) == pytest.approx(GAINS, rel=0.03)


def test_joints_are_matched_by_name_and_their_number_must_fit(runs):
    arm = load_gripper(str(ARM))
    swapped = runs[0].of_joints(["elbow", "shoulder"])
    np.testing.assert_array_equal(as_set([swapped], arm, "", "").grasps[0].position_m, runs[0].position)
    with pytest.raises(MeasurementError, match="slow: has 1 joint, elbow, and arm 2 motors; choose with 'joints="):
        as_set([runs[0].of_joints(["elbow"])], arm, "", "")
    with pytest.raises(
        MeasurementError, match=r"has 2 joints, shoulder, elbow, and so101_jaw 1 motor; .*joints=\[elbow\]"
    ):
        as_set(runs, load_gripper("so101_jaw"), "", "")


def test_a_parameter_writes_the_joint_that_it_names():
    arm = load_gripper(str(ARM))
    plant, ids = Plant(arm, 1), np.arange(1)
    for name, value in (("shoulder_damping", 0.7), ("elbow_gain", 9.0)):
        plant.write(arm.parameters[name].writes, ids, np.array([value]))
    assert plant.field("dof_damping")[0].tolist() == [0.7, 0.2]
    assert plant.field("actuator_gainprm")[0, :, 0].tolist() == [9.0, 15.0]


def test_effects_act_on_all_joints_alike():
    for effect in effects_of(load_gripper(str(ARM))).values():
        assert not [p.name for p in effect.parameters if "left" in p.name or "right" in p.name]


@pytest.mark.parametrize(
    ("old", "new", "match"),
    [
        ("dof_damping@elbow", "dof_damping@wrist", "dof_damping@wrist: is no motor's joint"),
        (
            "{joint: elbow, actuator: elbow_servo",
            "{joint: elbow, actuator: shoulder_servo",
            r"motors\[1\].actuator: sho",
        ),
        ("joint: elbow,", "joint: elbwo,", r"motors\[1\].joint: arm.xml has no 'elbwo'; did you mean elbow"),
    ],
)
def test_what_does_not_fit_the_scene_is_told(old, new, match, tmp_path):
    (tmp_path / "arm.xml").write_text(ARM.with_suffix(".xml").read_text())
    (tmp_path / "arm.yaml").write_text(ARM.read_text().replace(old, new))
    with pytest.raises(ConfigError, match=match):
        load_gripper(str(tmp_path / "arm.yaml"))
