"""A load behind a spring or behind play, against the equations of motion of two bodies."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from forcegrasp.effects import catalogue
from forcegrasp.effects.for_gripper import effect_of, why_left_out
from forcegrasp.physics.gripper import Gripper
from forcegrasp.physics.gripper_file import load_gripper
from forcegrasp.physics.plant import Plant

SCENE = """<mujoco><option timestep="0.0005" integrator="implicitfast"/>
<worldbody><body name="arm"><joint name="shoulder" type="hinge" axis="0 1 0" damping="0.05" armature="0.0072"/>
<inertial pos="0.1 0 -0.2" mass="0.6" diaginertia="1e-4 1e-4 1e-4"/></body></worldbody>
<actuator><position name="drive" joint="shoulder" kp="14" kv="1.1"/></actuator></mujoco>"""
DESCRIPTION = """format: forcegrasp-mechanism/1
name: arm
model: arm.xml
motors: [{joint: shoulder, actuator: drive, span: 1.5}]
command: position
effort: motor
period_s: 0.008
parameters:
  position_gain: {nominal: 14, low: 5, high: 40, unit: N·m/rad, scope: gripper,
    writes: [actuator_gainprm 0, -actuator_biasprm 1]}
"""
ROTOR, GAIN, SERVO_DAMPING, DAMPING, STEP_S = 0.0072, 14.0, 1.1, 0.05, 5e-5


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Gripper:
    """A servo that swings a weight that hangs obliquely."""
    folder: Path = tmp_path_factory.mktemp("arm")
    (folder / "arm.xml").write_text(SCENE)
    (folder / "arm.yaml").write_text(DESCRIPTION)
    return load_gripper(str(folder / "arm.yaml"))


def command(time: float) -> float:
    return (0.0, 0.5, 0.45, -0.3)[int(np.searchsorted((0.1, 0.5, 0.9), time + 1e-9))]  # times are sums


def two_bodies(arm: Gripper, times: np.ndarray, compliance: float, loss: float, gap: float) -> np.ndarray:
    """Motor's position and effort at these times, with the servo off from 1.2 s on, ``(times, 2)``."""
    model = arm.compile()
    data = mujoco.MjData(model)
    weight = []  # at no angle, and at a quarter turn
    for angle in (0.0, np.pi / 2):
        data.qpos[0] = angle
        mujoco.mj_forward(model, data)
        weight.append(data.qfrc_bias[0])
    load_inertia = model.dof_M0[0] - ROTOR
    bend = -weight[0] * compliance - gap / 2 * np.sign(weight[0])
    q, v, x, w, time, found = 0.0, 0.0, bend, 0.0, 0.0, []
    for end in times:
        given = None  # at the start of a step, as the engine has it
        while time < end - STEP_S / 2:
            force = GAIN * (command(time) - q) - SERVO_DAMPING * v if time < 1.2 - 1e-9 else 0.0
            given = force if given is None else given
            beyond = x - q - np.clip(x - q, -gap / 2, gap / 2)
            pull = (beyond + loss * (w - v)) / compliance if beyond else 0.0
            pull = pull if pull * beyond > 0 or not gap else 0.0
            v += STEP_S * (force - DAMPING * v + pull) / ROTOR
            w += STEP_S * (-pull - weight[0] * np.cos(x) - weight[1] * np.sin(x)) / load_inertia
            q, x, time = q + STEP_S * v, x + STEP_S * w, time + STEP_S
        found.append((q, given))
    return np.array(found)


def moved(arm: Gripper, name: str, values: list[float], step_factor: float = 0.5) -> tuple[np.ndarray, np.ndarray]:
    """Times, and the same of a plant that has the effect in one row and not in the other, ``(times, 2, rows)``."""
    plant = Plant(arm, 2, threads=1, step_factor=step_factor)
    plant.attach([(effect_of(name, arm)(np.array([values]), plant.dt), np.array([0]))])
    plant.reset(np.arange(2), np.zeros(2))
    found, times = [], plant.dt * np.arange(1, round(1.6 / plant.dt))
    for before in times - plant.dt:
        plant.disturb(np.zeros(2), np.full(2, before < 1.2 - 1e-9))
        plant.advance(np.full((2, 1), command(before)))
        found.append((plant.position[:, 0], plant.motor_force[:, 0]))
    assert not plant.warnings().any()
    return times, np.array(found)


def rms(values: np.ndarray) -> np.ndarray:
    return np.sqrt(np.square(values).mean(axis=0))


@pytest.mark.parametrize("values", [[0.0077, 0.0004], [0.02, 0.005]])
def test_a_load_behind_a_spring(arm, values):
    times, found = moved(arm, "elastic_joint", values)
    expected = two_bodies(arm, times, *values, gap=0.0)
    error, change = (rms(found[:, :, 0] - other) for other in (expected, found[:, :, 1]))
    assert (change > 20 * error).all()


def test_a_load_with_play(arm):
    values = [0.03, 0.0004, 0.0003]
    times, found = moved(arm, "loose_joint", values, step_factor=0.25)
    expected = two_bodies(arm, times, *values[1:], gap=values[0])
    error, change = (rms(found[:, :, 0] - other) for other in (expected, found[:, :, 1]))
    assert (change > 10 * error).all()


def test_what_has_no_gap_is_behind_a_spring(arm):
    (_, loose), (_, elastic) = (
        moved(arm, *p) for p in (("loose_joint", [0, 0.01, 1e-3]), ("elastic_joint", [0.01, 1e-3]))
    )
    np.testing.assert_array_equal(loose, elastic)


@pytest.mark.parametrize("name", ["elastic_joint", "loose_joint"])
def test_every_parameter_counts_and_a_reset_forgets(arm, name):
    """Rows with one parameter doubled move otherwise; in rows that are reset it is as on a fresh plant."""
    kind = effect_of(name, arm)
    sizes = np.array([kind.typical_values()] * (1 + len(kind.parameters)))
    sizes[1:] *= 1 + np.eye(len(kind.parameters))
    rows = np.arange(len(sizes))
    plant = Plant(arm, len(sizes), threads=1)
    plant.attach([(kind(sizes, plant.dt), rows)])
    plant.reset(rows, np.zeros(len(sizes)))

    def played(low: int, high: int) -> np.ndarray:
        found = []
        for index in range(low, high):
            plant.advance(np.full((len(sizes), 1), command(0.09 + index * plant.dt)))
            found.append(plant.position[:, 0].copy())
        return np.array(found)

    first = played(0, 400)
    assert (first[:, 1:] != first[:, :1]).any(axis=0).all()
    plant.reset(rows[1:], np.zeros(len(rows) - 1))
    np.testing.assert_array_equal(played(0, 400)[:, 1:], first[:, 1:])


@pytest.mark.parametrize("name", ["xl330_pendulum", "bam_pendulum", "dfki_pendulum"])
@pytest.mark.parametrize("effect", ["elastic_joint", "loose_joint"])
def test_any_size_is_stable(name, effect):
    mechanism = load_gripper(name)
    kind = effect_of(effect, mechanism)
    ends = np.array([[p.low + 1e-6 * p.high, p.typical, p.high] for p in kind.parameters])
    values = np.stack(np.meshgrid(*ends), axis=-1).reshape(-1, len(ends))
    plant = Plant(mechanism, len(values), threads=1)
    plant.attach([(kind(values, plant.dt), np.arange(len(values)))])
    plant.reset(np.arange(plant.n), np.zeros(plant.n))
    size = 0.3 if mechanism.command == "position" else 0.0
    for goal in np.repeat([size, -size, 0.0], 300):
        plant.advance(np.full((plant.n, 1), goal))
        assert np.abs(plant.position).max() < 3
    assert not plant.warnings().any()


def test_it_needs_a_rotor_and_a_load():
    for effect in ("elastic_joint", "loose_joint"):
        assert why_left_out(catalogue()[effect], load_gripper("emps")).startswith("needs one joint that moves a load")
        assert "servos alone" in why_left_out(catalogue()[effect], load_gripper("tiago"))
