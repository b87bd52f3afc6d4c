"""A simulation that diverged says so: which grasp, with which parameters."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from forcegrasp.errors import PhysicsError
from forcegrasp.physics import GraspSimulator, guard


@pytest.fixture
def simulator(draw, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    simulator = GraspSimulator(4, threads=2)
    simulator.reset(draw(4))
    for _ in range(3):
        simulator.step(np.full((4, 2), -0.002))
    yield simulator
    assert not list(tmp_path.iterdir())  # MuJoCo would leave MUJOCO_LOG.TXT


def _expect(simulator: GraspSimulator, grasp: int, kind: str, delta: float = 0.0) -> None:
    with pytest.raises(PhysicsError) as caught:
        simulator.step(np.full((4, 2), delta))
    message = str(caught.value)
    assert f"grasp {grasp} diverged at control step 3" in message
    assert kind in message
    assert simulator.parameters.describe(grasp) in message


@pytest.mark.parametrize("grasp", range(4))
def test_bad_command(simulator, grasp):
    delta = np.zeros((4, 2))
    delta[grasp, 1] = np.nan
    with pytest.raises(PhysicsError, match=rf"grasp {grasp} .*bad commands.*kappa=.*radius_m="):
        simulator.step(delta)


@pytest.mark.parametrize(("field", "value"), [("qpos", np.nan), ("qpos", 1e12), ("qvel", np.nan), ("qvel", 1e12)])
def test_bad_state(simulator, field, value):
    simulator.plant.batch.bind(field)[2, -1] = value
    _expect(simulator, 2, {"qpos": "bad positions", "qvel": "bad velocities"}[field])


def test_bad_acceleration(simulator):
    simulator.plant.batch.bind("xfrc_applied")[1, simulator.model.body("object").id] = 1e14
    _expect(simulator, 1, "bad accelerations")


def test_the_first_of_several_is_named(simulator):
    simulator.plant.batch.bind("qpos")[[1, 3], -1] = np.nan
    _expect(simulator, 1, "bad positions")


def test_the_step_is_that_of_the_grasp(draw):
    warnings = np.zeros((3, 8), int)
    warnings[1, 0] = 1
    with pytest.raises(PhysicsError, match="grasp 1 diverged at control step 7 "):
        guard.check(warnings, draw(3), np.array([3, 7, 11]))


def test_error_stands_until_the_grasp_is_reset(simulator, draw):
    simulator.plant.batch.bind("qpos")[2, -1] = np.nan
    for _ in range(2):
        with pytest.raises(PhysicsError, match="grasp 2"):
            simulator.step(np.zeros((4, 2)))
    grasp = draw(1, seed=5)
    simulator.reset(grasp, np.array([2]))
    fresh = GraspSimulator(1, threads=1)
    fresh.reset(grasp)
    for _ in range(20):
        simulator.step(np.full((4, 2), -0.003))
        fresh.step(np.full((1, 2), -0.003))
    np.testing.assert_array_equal(simulator.joint_position[2], fresh.joint_position[0])
    np.testing.assert_array_equal(simulator.force[2], fresh.force[0])


def test_a_single_grasp_is_guarded_too(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    simulator = GraspSimulator(1, "fast", threads=1)
    with pytest.raises(PhysicsError, match="grasp 0 diverged at control step 0"):
        simulator.step(np.array([[0.0, np.nan]]))


def test_no_step_is_timed_unless_somebody_set_a_clock():
    model = mujoco.MjModel.from_xml_string("<mujoco/>")

    def duration() -> float:
        data = mujoco.MjData(model)
        mujoco.mj_step(model, data, 1000)
        return data.timer[mujoco.mjtTimer.mjTIMER_STEP].duration

    mujoco.set_mjcb_time(lambda: 1.0)
    guard.stop_clock()
    try:
        assert mujoco.get_mjcb_time() is not None
    finally:
        mujoco.set_mjcb_time(None)
    assert duration() > 0
    guard.stop_clock()
    assert duration() == 0
