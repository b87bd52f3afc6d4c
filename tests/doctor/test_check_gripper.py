"""What the doctor says of a gripper: what follows from its description, and what is wrong with its scene."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np
import pytest

from forcegrasp.cli.main import main
from forcegrasp.doctor.gripper import _creep, _heavier, _lighter, check_gripper
from forcegrasp.errors import ConfigError
from forcegrasp.physics import load_gripper, shipped_grippers
from forcegrasp.physics.plant import Plant, write_base

SECOND = Path(__file__).parents[1] / "grippers"
Changed = Callable[..., str]


@pytest.fixture
def changed(tmp_path) -> Changed:
    """``changed(xml={old: new}, yaml={...})``: path of a gripper of two slides with other lines."""

    def write(**changes: dict[str, str]) -> str:
        for kind in ("xml", "yaml"):
            text = (SECOND / f"second.{kind}").read_text("utf-8")
            for old, new in changes.get(kind, {}).items():
                assert old in text
                text = text.replace(old, new)
            (tmp_path / f"second.{kind}").write_text(text, "utf-8")
        return str(tmp_path / "second.yaml")

    return write


def said(name: str) -> dict[str, list[str]]:
    """Level → lines."""
    found: dict[str, list[str]] = {}
    for finding in check_gripper(name):
        found.setdefault(finding.level, []).append(finding.line())
    return found


def _speed_after_a_step(plant: Plant, push: float) -> np.ndarray:
    """Of the motors, from rest in free air, where a load pushes them, ``(motors,)``."""
    plant.reset(np.arange(1), np.zeros(1))
    plant.disturb(np.full(1, push), np.ones(1, bool))
    plant.advance(plant.position.copy())
    return plant.velocity[0]


@pytest.mark.parametrize("name", [*shipped_grippers(), "so101_jaw", str(SECOND / "second.yaml")])
def test_grippers_that_work_are_fine(name):
    found = said(name)
    assert set(found) <= {"fine", "note"}
    assert all("heavier than the scene says" in line for line in found.get("note", []))
    assert ("note" in found) == (name in ("franka_hand", "robotiq_2f85", str(SECOND / "second.yaml")))


@pytest.mark.parametrize(("servo", "integrator"), [("0", "Euler"), ("40", "Euler"), ("40", "implicitfast")])
def test_how_much_heavier_steps_make_a_motor_is_what_a_push_shows(changed, servo, integrator):
    lines = {'integrator="implicitfast"': f'integrator="{integrator}"', 'kv="20"': f'kv="{servo}"'}
    path = changed(xml=lines | {'frictionloss="0.05"': ""})
    plant = Plant(load_gripper(path), 1, threads=1)
    still, pushed = (_speed_after_a_step(plant, push) for push in (0.0, 0.5))
    inertia = 0.5 * plant.dt / (pushed - still)
    assert inertia / plant.inertia[0] == pytest.approx(1 + _heavier(plant), rel=1e-3)


@pytest.mark.parametrize(
    ("servo", "integrator", "told"), [("40", "Euler", True), ("20", "Euler", False), ("40", "RK4", False)]
)
def test_a_servo_whose_steps_make_its_motor_lighter(changed, servo, integrator, told):
    lines = {'integrator="implicitfast"': f'integrator="{integrator}"', 'kv="20"': f'kv="{servo}"'}
    path = changed(xml=lines)
    notes = said(path).get("note", [])
    lighter = 'lighter, as kv acts by the speed at their start; take integrator="implicitfast"'
    assert any(lighter in line for line in notes) == told
    plant = Plant(load_gripper(path), 1, threads=1)
    assert (_lighter(plant) > 0) == (integrator == "Euler")


@pytest.mark.parametrize(
    ("lines", "told"),
    [
        ('frictionloss="0.6"', True),
        ('frictionloss="0.6" solreffriction="-100 -50"', True),
        ('frictionloss="0.6" solreffriction="0.004 1" solimpfriction="0.999 0.9999 0.001"', False),
    ],
)
def test_how_fast_an_object_creeps_on_its_table_is_what_a_push_shows(changed, lines, told):
    path = changed(xml={'damping="2" frictionloss="0.1"': lines})
    gripper = load_gripper(path)
    plant = Plant(gripper, 1, threads=1)
    model, dof = plant.model, int(plant.model.joint(gripper.object_joint).dofadr[0])
    data = mujoco.MjData(model)
    data.qpos[model.joint(gripper.object_joint).qposadr[0]] += 0.2  # out of reach of the fingers
    data.qfrc_applied[dof] = 0.3
    for _ in range(1000):
        mujoco.mj_step(model, data)
    assert data.qvel[dof] == pytest.approx(_creep(gripper, plant), rel=0.02)
    assert any("creeps by" in line for line in said(path).get("note", [])) == told


def test_a_contact_of_one_impedance_is_as_stiff_as_its_solref_says(changed):
    """docs/your-gripper.md: in proportion, so that one look tells what to write for a stiffness that is known."""
    found = []
    for stiffness in (4000, 20000):
        path = changed(
            xml={'solref="-900 -60" solimp="0.6 0.95 0.004 0.5 2"': f'solref="-{stiffness} -60" solimp="0.5 0.5 0.001"'}
        )
        (line,) = (line for line in said(path)["fine"] if "N/m on each side" in line)
        found.append(float(line.split(" N/m")[0].split()[-1]))
        assert line.endswith("with an impedance of 0.5")
        damping = float(line.split(" N·s/m")[0].split()[-1])
        assert damping / found[-1] == pytest.approx(60 / stiffness, rel=0.01)
    assert found[1] / found[0] == pytest.approx(5.0, rel=0.02)


def test_sides_of_other_masses_make_one_object_stiffer_on_one_side(changed):
    heavy = {'<joint name="west"/>': '<joint name="west"/><geom size="0.001" mass="0.3" contype="0" conaffinity="0"/>'}
    assert "stiffer on one side" in " ".join(said(changed(xml=heavy))["note"])


@pytest.mark.parametrize("more", [0.0, 0.005])
def test_fingers_that_open_into_the_range_of_their_joints_meet_a_stop(changed, more):
    """As any that overshoot: the servo's damping is taken away."""
    lines = {
        'range="0 0.05" armature': f'range="{-more:g} 0.05" armature',
        'kv="20"': 'kv="0"',
        'damping="40"': 'damping="12"',
    }
    found = said(changed(xml=lines, yaml={"nominal: 40, low": "nominal: 12, low"}))
    assert any("into the joints' range" in line for line in found.get("note", [])) == (more == 0)
    assert not found.get("warning")


@pytest.mark.parametrize(("nominal", "told"), [("250", False), ("251", False), ("300", True)])
def test_a_nominal_that_is_not_the_scenes(changed, nominal, told):
    found = said(changed(yaml={"nominal: 250": f"nominal: {nominal}"}))
    lines = [
        line for line in found.get("warning", []) if f"servo_stiffness is {nominal}, and second.xml has 250" in line
    ]
    assert len(lines) == told


def test_motors_that_differ_are_told_to_have_a_parameter_each(changed):
    """One parameter would give both the same: a set with nothing hidden then shows motors that are unlike."""
    line = 'name="drive_east" joint="east"'
    scene = {line: line + ' kp="240"'}
    (warned,) = said(changed(xml=scene))["warning"]
    assert "gives each joint the same actuator_gainprm 0, and second.xml has 250 and 240" in warned
    assert "actuator_gainprm@west 0" in warned
    both = "servo_stiffness: {nominal: 250, low: 100, high: 800, unit: N/m, scope: gripper, writes: "
    old = both + "[actuator_gainprm 0, -actuator_biasprm 1]}"
    each = [
        f"  {side}_{both}[actuator_gainprm@{side} 0, -actuator_biasprm@{side} 1]}}".replace("250", nominal)
        for side, nominal in (("west", "250"), ("east", "240"))
    ]
    path = changed(xml=scene, yaml={"  " + old: "\n".join(each)})
    assert "warning" not in said(path)
    plant, ids = Plant(load_gripper(path), 1, threads=1), np.arange(1)
    write_base(plant, ids, {"east_servo_stiffness": np.array([300.0])})
    assert plant.field("actuator_gainprm")[0, :, 0].tolist() == [250, 300]


def test_what_follows_from_the_description_is_told_in_users_units():
    lines = " ".join(said("robotiq_2f85")["fine"])
    for told in ("85.0 mm between the pads when open", "0.8 rad", "q_rad, qdes_rad, f_l_n, f_r_n", "7.21 and 7.21 N"):
        assert told in lines


def test_what_an_effort_counts_as_is_told_where_it_is_read():
    gripper = load_gripper("so101_gripper")
    (forces,) = (line for line in said("so101_gripper")["fine"] if "contact above" in line)
    closed, opened = gripper.opening.opening_at(np.array([0.0, gripper.stroke]))
    factor = float(forces.split("; ")[-1].split(" N for each N·m")[0])
    assert factor == pytest.approx(gripper.stroke / (opened - closed), rel=0.03)
    assert not any("effort" in line for line in said("tiago")["fine"])


def test_a_scene_in_place_of_its_description_is_told(changed):
    scene = str(Path(changed()).with_suffix(".xml"))
    with pytest.raises(ConfigError, match=r"second\.xml: a scene; give the description that names it"):
        load_gripper(scene)


def test_a_description_that_is_refused_is_told_in_a_line(changed):
    (line,) = said(changed(yaml={"geom: thing": "geom: thong"}))["mend"]
    assert "thong" in line


def test_a_side_that_does_not_touch(changed):
    (line,) = said(changed(xml={'pos="0.354 0 0.1"': 'pos="0.354 0.5 0.1"'}))["mend"]
    assert "the right side does not touch an object of 20 mm radius" in line


def test_a_sensor_that_does_not_feel_what_presses(changed):
    (line,) = said(changed(xml={'<site name="east"': '<site name="east" size="0.001 0.001 0.001"'}))["warning"]
    assert "the right one reads 0 N where 0.833 N press" in line


@pytest.mark.parametrize(("said_n", "told"), [(1.6, False), (1.7, True)])
def test_a_force_that_full_steps_do_not_reach(said_n, told, monkeypatch):
    second = load_gripper(str(SECOND / "second.yaml"))
    training = dataclasses.replace(second.training, max_force_n=said_n)
    monkeypatch.setattr("forcegrasp.physics.load_gripper", lambda _: dataclasses.replace(second, training=training))
    lines = said("second").get("warning", [])
    assert (
        any(f"max_force_n is {said_n} N, and full steps" in line and "with 0.833 N" in line for line in lines) == told
    )


def test_contacts_that_depend_on_the_collision_code(changed):
    round_object = {'type="box" size="0.02 0.03 0.03"': 'type="cylinder" size="0.02 0.03"'}
    (line,) = said(changed(xml=round_object))["warning"]
    assert "× the noise apart" in line


@pytest.mark.parametrize(("force_std_n", "compared"), [(0.1, True), (0.0, False)])
def test_readings_without_noise_are_no_yardstick(force_std_n, compared, monkeypatch):
    hand = load_gripper("franka_hand")
    training = dataclasses.replace(hand.training, position_std=0.0, force_std_n=force_std_n)
    monkeypatch.setattr("forcegrasp.physics.load_gripper", lambda name: dataclasses.replace(hand, training=training))
    lines = " ".join(said("franka_hand")["fine"])
    assert ("collision codes" in lines) == compared
    assert "nan" not in lines


def test_a_scene_that_diverges(changed, monkeypatch):
    monkeypatch.setattr(Plant, "warnings", lambda plant: np.ones((plant.n, 1), int))
    (line,) = said(changed())["mend"]
    assert "can't be simulated" in line


def test_a_gripper_is_asked_for_by_an_option(capsys):
    assert main(["doctor", "gripper=franka_hand"]) == 0
    out = capsys.readouterr().out
    assert "80.0 mm between the pads" in out
    assert "python" not in out.lower()
    assert main(["doctor", "gripper=no_such_hand"]) == 1
    for wrong in (["gripper="], ["gripper"], ["gripper=tiago", "gripper=tiago"]):
        assert main(["doctor", *wrong]) == 2
