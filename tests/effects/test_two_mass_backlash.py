"""Two bodies with a gap between them, against the equations of motion with stiff ends."""

from __future__ import annotations

import numpy as np
import pytest

from forcegrasp.effects import catalogue, get_effect
from forcegrasp.effects.for_gripper import effects_of, why_left_out
from forcegrasp.physics.gripper_file import load_gripper
from forcegrasp.physics.plant import Plant

from .rollouts import make_plant, start
from .signals import GAIN, settle

ROTOR_KG, FINGER_KG, DAMPING, SERVO_DAMPING = 0.1, 0.10998, 1.0, 7.0
GAP_M, STEP_S = 0.0006, 2e-5


def clip(value: float, low: float, high: float) -> float:
    """As numpy's, which takes ten times as long for a single number."""
    return min(max(value, low), high)


def command(time: float) -> float:
    """A ramp that ends, a rest, a small step back, and the same way back at full speed, metres."""
    if time < 0.8:
        return 0.03 + 0.06 * clip(time - 0.1, 0.0, 0.2)
    return 0.0413 if time < 1.2 else 0.032


def two_bodies(times: np.ndarray, variant: str, finger_share: float) -> np.ndarray:
    """Positions of motor and finger, metres, ``(times, 2)``: two bodies, and ends that are stiff and damped."""
    stiffness = 4e4
    damper = 2 * np.sqrt(stiffness * ROTOR_KG * FINGER_KG / (ROTOR_KG + FINGER_KG))
    motor = finger = 0.03
    motor_v = finger_v = time = 0.0
    found = []
    for end in times:
        while time < end - STEP_S / 2:
            known = motor if variant == "motor_encoder" else finger
            force = clip(GAIN * (command(time) - known) - SERVO_DAMPING * motor_v, -1.0, 1.0)
            beyond = motor - finger - clip(motor - finger, -GAP_M / 2, GAP_M / 2)
            push = stiffness * beyond + damper * (motor_v - finger_v) if beyond else 0.0
            push = push if push * beyond > 0 else 0.0
            motor_v += STEP_S * (force - (1 - finger_share) * DAMPING * motor_v - push) / ROTOR_KG
            finger_v += STEP_S * (push - finger_share * DAMPING * finger_v) / FINGER_KG
            motor, finger, time = motor + STEP_S * motor_v, finger + STEP_S * finger_v, time + STEP_S
        found.append((motor, finger))
    return np.array(found)


def moved(plant: Plant, times: np.ndarray) -> np.ndarray:
    """Positions of the left motor and finger of a plant, metres, ``(times, 2)``."""
    found = []
    for index in range(len(times)):
        plant.advance(np.full((1, 2), command(index * plant.dt)))
        found.append((plant.position[0, 0], plant.joint_position[0, 0]))
    return np.array(found)


@pytest.mark.parametrize("share", [0.2, 0.8])
@pytest.mark.parametrize("variant", ["motor_encoder", "finger_encoder"])
def test_motor_and_finger_move_as_two_bodies(variant, share):
    plant = Plant(load_gripper("tiago"), 1, threads=1, step_factor=0.25)
    effect = get_effect("two_mass_backlash")(np.array([[GAP_M, share]]), plant.dt, variant)
    plant.attach([(effect, np.array([0]))])
    plant.field("actuator_biasprm")[:, :, 2] = plant.base("actuator_biasprm")[:, :, 2] = -SERVO_DAMPING
    plant.reset(np.arange(1), np.zeros(1), np.full((1, 2), 0.03))
    times = np.arange(1, round(1.7 / plant.dt)) * plant.dt
    expected = two_bodies(times, variant, share)
    assert np.ptp(expected[:, 0] - expected[:, 1]) > 0.99 * GAP_M  # it crosses all of it
    found = moved(plant, times)
    if variant == "finger_encoder":
        found, expected = found[:, 1:], expected[:, 1:]  # only the finger is known
    np.testing.assert_allclose(found, expected, atol=GAP_M / 10)  # a step of a motor at full speed
    np.testing.assert_allclose(found[-1], expected[-1], atol=1e-5)


def test_a_finger_runs_past_the_end_of_its_motors_range():
    plant = make_plant(1, [(get_effect("two_mass_backlash"), (0.002, 0.1), "", [0])], "reference")
    plant.reset(np.arange(1), np.zeros(1), np.full((1, 2), 0.035))
    plant.advance(np.full((1, 2), 0.045), 1000)
    assert plant.position[0, 0] == pytest.approx(0.045, abs=1e-6)
    assert plant.joint_position[0, 0] == pytest.approx(0.046, abs=1e-6)


def test_an_object_pushes_the_finger_back_at_once():
    """It does not hold while the motor crosses, as a finger does that its guide holds."""
    closed = (0.0245, 0.023, 0.022, 0.021)
    before = settle("two_mass_backlash", (0.001, 0.5), *closed)
    after = settle("two_mass_backlash", (0.001, 0.5), *closed, 0.0215)
    assert np.all(after.pad_force < 0.8 * before.pad_force)
    np.testing.assert_allclose(before.position - before.joint_position, -0.0005, atol=1e-6)


def test_friction_holds_the_motor_and_not_the_finger():
    """A motor that its friction stops at once, and a finger that runs on to the other end of the gap."""
    uses = [(get_effect("coulomb_friction"), (0.3,), "", [0]), (get_effect("two_mass_backlash"), (0.004, 0.0), "", [0])]
    plant = make_plant(1, uses, "reference")
    start(plant, [0])
    plant.advance(np.full((1, 2), 0.045), 30)
    assert plant.position[0, 0] - plant.joint_position[0, 0] == pytest.approx(0.002)
    stop = plant.position.copy()
    plant.advance(stop, 20)
    motor, finger = plant.position[0, 0] - stop[0, 0], plant.joint_position[0, 0] - stop[0, 0]
    assert motor < 0.0006 < finger


def test_what_pushes_a_motor_pushes_it_in_the_gap_too():
    """A motor rests where its servo makes up for the push, whether the finger is at an end or not."""
    push = (0.03, -0.03)
    uses = [(get_effect("motor_offset"), push, "", [0]), (get_effect("two_mass_backlash"), (0.006, 0.5), "", [0])]
    plant = make_plant(1, uses, "reference")
    start(plant, [0])
    before = plant.joint_position.copy()
    plant.advance(before, 800)
    np.testing.assert_allclose(plant.position - before, np.array([push]) / GAIN, atol=1e-5)
    np.testing.assert_allclose(plant.joint_position, before, atol=1e-6)


def test_a_gripper_needs_motors_with_inertia_that_slide_fingers():
    assert "two_mass_backlash" in effects_of(load_gripper("tiago"))
    for name in ("robotiq_2f85", "so101_gripper"):
        assert why_left_out(catalogue()["two_mass_backlash"], load_gripper(name)).startswith("needs motors that slide")
