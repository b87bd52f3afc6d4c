"""The fast tier's larger steps and its sphere, on TIAGo and on grippers that could not take them."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import mujoco
import numpy as np
import pytest

from forcegrasp.identify.simulators import cheap_tier
from forcegrasp.physics import GraspParameters, GraspSimulator, fast
from forcegrasp.physics.gripper_file import load_gripper
from forcegrasp.physics.plant import Plant

TIAGO = load_gripper("tiago")
SECOND = load_gripper(str(Path(__file__).parents[1] / "grippers" / "second.yaml"))


def _fast(spec: mujoco.MjSpec) -> mujoco.MjModel:
    return fast.compile_fast(spec, TIAGO.motors, TIAGO.object_geom, TIAGO.axis)


def _spec(stiffness: float = 100.0, time_constant: float = 0.02) -> mujoco.MjSpec:
    spec = mujoco.MjSpec.from_file(str(TIAGO.model))
    for actuator in spec.actuators:
        actuator.gainprm[0], actuator.biasprm[1] = stiffness, -stiffness
    spec.geom("object").solref[0] = time_constant
    return spec


@pytest.mark.parametrize("b2", [-13.0, -9.0, -6.0])
def test_free_fingers_move_as_with_small_steps(b2):
    """What a larger step does to the servo is taken back: without that they would be 1 mm apart in the end."""
    simulators = [GraspSimulator(1, tier, threads=1) for tier in ("reference", "fast")]
    for simulator in simulators:
        simulator.reset(GraspParameters(0.5, b2, 0.015, 0.0, 0.1))
    for _ in range(25):
        for simulator in simulators:
            simulator.step(np.full((1, 2), -0.003))
        slow, quick = (simulator.joint_position for simulator in simulators)
        assert quick == pytest.approx(slow, abs=0.07e-3)


@pytest.mark.parametrize(
    ("stiffness", "time_constant", "step"),
    [(100, 0.02, 0.008), (600, 0.02, 0.004), (5000, 0.02, 0.002), (100, 0.01, 0.004), (100, 0.005, 0.002)],
)
def test_steps_suit_servo_and_contact(stiffness, time_constant, step):
    model = _fast(_spec(stiffness, time_constant))
    assert model.opt.timestep == step
    assert model.dof_damping[-2:] == pytest.approx(1 + stiffness * (step - 0.002) / 2)


def test_the_sphere_stays_between_the_pads():
    """The object sinks into the soft floor, and the sphere would sink with it."""
    simulator = GraspSimulator(1, "fast", threads=1)
    simulator.reset(GraspParameters(0.5, -9.0, 0.025, 0.0, 0.1))
    for _ in range(50):
        simulator.step(np.full((1, 2), -0.001))
    model, data = simulator.scene(0)
    assert data.geom("object").xpos[2] == pytest.approx(0.0468, abs=0.2e-3)
    assert data.geom("object_pads").xpos[2] == pytest.approx(data.geom("pad_l1").xpos[2], abs=0.2e-3)
    assert model.ngeom == TIAGO.compile().ngeom + 1


def test_an_object_that_never_rests_keeps_the_sphere_in_its_middle():
    spec = _spec()
    spec.delete(spec.geom("floor"))
    assert _fast(spec).geom("object_pads").pos == pytest.approx(0)


@pytest.mark.parametrize(
    ("tier", "step"), [("reference", 1e-3), ("fast", 1e-3), ("fitting", 2e-3), ("screening", 4e-3)]
)
def test_fits_take_larger_steps_of_a_gripper_without_a_sphere(tier, step):
    """Slopes that cost half of the time are worth it for any gripper, and the scene stays as it is described."""
    model = SECOND.compile(tier)
    assert (model.opt.timestep, model.ngeom) == (step, SECOND.compile().ngeom)


@pytest.mark.parametrize("astray", [1e-3, np.nan])
@pytest.mark.parametrize("bears", [4, 2, 1])
def test_steps_are_as_large_as_grasps_go_the_same_way_with_them(bears, astray, monkeypatch):
    model, places = SECOND.compile(), fast._places_in_a_grasp

    def elsewhere_with_too_large_steps(changed, motors):
        times, found = places(changed, motors)
        return times, found + (0.0 if changed.opt.timestep < 1.1e-3 * bears else astray)

    monkeypatch.setattr(fast, "_places_in_a_grasp", elsewhere_with_too_large_steps)
    found = fast.with_larger_steps(model, SECOND.motors, SECOND.object_geom, 4)
    assert found.opt.timestep == pytest.approx(1e-3 * bears)
    assert model.opt.timestep == 1e-3
    assert (found.dof_damping != model.dof_damping).any() == (bears > 1)


def test_a_scene_that_steps_as_its_drive_samples_keeps_its_steps():
    drive = dataclasses.replace(SECOND, period_s=1e-3)
    assert drive.compile("screening").opt.timestep == 1e-3
    assert cheap_tier(drive) == "reference"
    assert cheap_tier(SECOND) == "fitting"


def test_a_damping_that_is_written_keeps_what_the_step_needs():
    gripper = SECOND
    plant = Plant(dataclasses.replace(gripper, fast="sphere"), 2, "fast", threads=1)
    reference = Plant(gripper, 2, threads=1)
    made_up = plant.model.dof_damping - reference.model.dof_damping
    assert made_up.max() > 0
    for one in (plant, reference):
        one.write(gripper.parameters["joint_damping"].writes, np.arange(2), np.array([20.0, 50.0]))
    fingers = reference.motor_dofs
    difference = plant.field("dof_damping")[:, fingers] - reference.field("dof_damping")[:, fingers]
    assert difference == pytest.approx(np.broadcast_to(made_up[fingers], (2, 2)))


@pytest.mark.parametrize(("name", "step"), [("franka_hand", 0.004), ("robotiq_2f85", 0.004), ("so101_gripper", 0.008)])
def test_all_that_a_motor_moves_counts_in_its_step(name, step):
    """A servo is slower by what is coupled to its joint; held forces and positions stay those of small steps."""
    gripper, ends = load_gripper(name), []
    for tier in ("reference", "fast"):
        simulator = GraspSimulator(1, tier, threads=1, gripper=gripper)
        for _ in range(60):
            simulator.step(np.full((1, 1), -gripper.max_step / 4))
        ends.append((simulator.joint_position, simulator.force))
    assert simulator.model.opt.timestep == step
    (slow, slow_force), (quick, quick_force) = ends
    assert quick == pytest.approx(slow, abs=gripper.training.position_std)
    assert quick_force == pytest.approx(slow_force, abs=gripper.training.force_std_n)
