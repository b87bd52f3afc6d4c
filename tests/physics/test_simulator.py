"""Batched simulation: the same bits however it is run, and the gripper's measured laws."""

from __future__ import annotations

import numpy as np
import pytest

from forcegrasp.physics import GraspParameters, GraspSimulator

TIERS = pytest.mark.parametrize("tier", ["reference", "fast"])
STEPS = 45


def _act(n: int, steps: int = STEPS, seed: int = 5) -> np.ndarray:
    """Position deltas that close at different speeds, then squeeze and release, ``(steps, n, 2)``."""
    rng = np.random.default_rng(seed)
    closing = rng.uniform(-1, -0.5, (1, n, 2)) * np.ones((steps, 1, 1))
    squeezing = rng.uniform(-1, 0.4, (steps, n, 2))
    return 0.003 * np.where(np.arange(steps)[:, None, None] < 2 * steps // 3, closing, squeezing)


def _state(simulator: GraspSimulator) -> np.ndarray:
    """Everything that a simulation tells, ``(n, 8)``."""
    columns = (
        simulator.joint_position,
        simulator.commanded_position,
        simulator.force,
        simulator.object_position[:, None],
        simulator.object_speed[:, None],
    )
    return np.concatenate(columns, axis=1)


def _run(simulator: GraspSimulator, deltas: np.ndarray) -> np.ndarray:
    states = []
    for delta in deltas:
        simulator.step(delta)
        states.append(_state(simulator))
    return np.stack(states)


def _fresh(grasps: GraspParameters, deltas: np.ndarray, tier: str, threads: int = 1) -> np.ndarray:
    simulator = GraspSimulator(len(grasps), tier, threads)
    simulator.reset(grasps)
    return _run(simulator, deltas)


@TIERS
def test_threads_do_not_change_a_bit(draw, tier):
    grasps, deltas = draw(12), _act(12)
    one = _fresh(grasps, deltas, tier, threads=1)
    np.testing.assert_array_equal(one, _fresh(grasps, deltas, tier, threads=2))
    assert (one[:, :, 4:6] > 0).any(axis=(0, 2)).mean() > 0.8  # the comparison is about contact


@TIERS
def test_batch_size_does_not_change_a_bit(draw, tier):
    grasps, deltas = draw(64), _act(64)
    together = _fresh(grasps, deltas, tier)
    for i in (0, 31, 63):
        np.testing.assert_array_equal(together[:, i : i + 1], _fresh(grasps[i], deltas[:, i : i + 1], tier))


@TIERS
def test_a_slot_forgets_what_it_simulated_before(draw, tier):
    simulator = GraspSimulator(8, tier, threads=1)
    simulator.reset(draw(8, seed=1))
    _run(simulator, _act(8, seed=2))
    grasps, deltas = draw(8, seed=3), _act(8)
    simulator.reset(grasps)
    assert not simulator.steps.any()
    np.testing.assert_array_equal(_run(simulator, deltas), _fresh(grasps, deltas, tier))


@TIERS
def test_partial_reset_touches_its_slots_only(draw, tier):
    n, ids = 8, np.array([1, 5])
    grasps, deltas = draw(n, seed=1), _act(n, 2 * STEPS)
    undisturbed = _fresh(grasps, deltas, tier)

    simulator = GraspSimulator(n, tier, threads=1)
    simulator.reset(grasps)
    _run(simulator, deltas[:STEPS])
    before = _state(simulator)
    new = draw(2, seed=9)
    simulator.reset(new, ids)
    others = np.setdiff1d(np.arange(n), ids)
    np.testing.assert_array_equal(_state(simulator)[others], before[others])
    np.testing.assert_array_equal(simulator.parameters.as_array()[ids], new.as_array())
    np.testing.assert_array_equal(simulator.parameters.as_array()[others], grasps.as_array()[others])
    np.testing.assert_array_equal(simulator.steps, np.where(np.isin(np.arange(n), ids), 0, STEPS))

    after = _run(simulator, deltas[STEPS:])
    np.testing.assert_array_equal(after[:, others], undisturbed[STEPS:, others])
    np.testing.assert_array_equal(after[:, ids], _fresh(new, deltas[STEPS:, ids], tier))


@pytest.mark.parametrize("ids", [None, np.array([0, 2])])
def test_reset_opens_the_gripper(draw, ids):
    simulator = GraspSimulator(3, threads=1)
    simulator.reset(GraspParameters(0.5, -9, 0.035, [0.003, -0.004, 0.005], 0.1))
    _run(simulator, np.full((14, 3, 2), -0.003))
    assert simulator.force.any(axis=1).all()
    assert simulator.object_speed.all()
    slots = np.arange(3) if ids is None else ids
    grasps = draw(len(slots))
    simulator.reset(grasps, ids)
    assert (simulator.joint_position[slots] == 0.045).all()
    assert (simulator.commanded_position[slots] == 0.045).all()
    np.testing.assert_array_equal(simulator.object_position[slots], grasps.offset_m)
    assert not simulator.force[slots].any()
    assert not simulator.object_speed[slots].any()


def test_reset_wants_one_grasp_per_slot(draw):
    simulator = GraspSimulator(3, threads=1)
    with pytest.raises(ValueError, match="2 grasps for 3 slots"):
        simulator.reset(draw(2))
    before = simulator.parameters.as_array()
    simulator.reset(draw(1)[np.array([], int)], np.array([], int))
    np.testing.assert_array_equal(simulator.parameters.as_array(), before)


def test_commands_are_relative_to_the_position_and_clipped():
    simulator = GraspSimulator(2, threads=1)
    for delta in ([[-0.003, 0.001], [-0.001, -0.05]], [[-0.001, -0.003], [0.003, 0.003]]):
        before = simulator.joint_position
        simulator.step(np.array(delta))
        np.testing.assert_array_equal(simulator.commanded_position, np.clip(before + delta, 0, 0.045))
    simulator.command(np.array([[0.01, 0.02], [-1.0, 1.0]]))
    np.testing.assert_array_equal(simulator.commanded_position, [[0.01, 0.02], [0, 0.045]])


def test_object_speed_is_metres_per_control_step(draw):
    grasps = draw(6, radius_m=[0.03, 0.035])
    states = _fresh(grasps, _act(6), "reference")
    position, speed = np.concatenate([grasps.offset_m[None], states[:, :, 6]]), states[:, :, 7]
    np.testing.assert_array_equal(speed, np.abs(np.diff(position, axis=0)))
    assert speed.max() > 5e-5


def test_arrays_handed_out_are_copies():
    simulator = GraspSimulator(1, threads=1)
    position, object_position = simulator.joint_position, simulator.object_position
    position[:], object_position[:] = 0.01, 0.02
    assert simulator.joint_position[0, 0] == 0.045
    assert simulator.object_position[0] == 0


def test_looking_at_a_scene_changes_nothing(draw):
    grasps, deltas = draw(3, radius_m=[0.03, 0.035]), _act(3)
    simulator = GraspSimulator(3, threads=1)
    simulator.reset(grasps)
    states = []
    for delta in deltas:
        simulator.step(delta)
        states.append(_state(simulator))
        _, data = simulator.scene(1)
        assert data.joint("finger_l").qpos[0] == simulator.joint_position[1, 0]
    np.testing.assert_array_equal(np.stack(states), _fresh(grasps, deltas, "reference"))
    assert data.ncon == 13  # 10 pads, 3 on the floor


@TIERS
def test_force_is_the_scaled_position_delta(tier):
    """f = 100 N/m · f_α · Δq. One finger reads up to 3 % more than the other; their mean is within 1 %."""
    kappa, delta = (grid.ravel() for grid in np.meshgrid([0, 0.5, 1], np.arange(2, 11, 2) * 3e-4))
    grasps = GraspParameters(kappa, -9, 0.03, 0, 0.1)
    held = -np.repeat(delta[:, None], 2, axis=1)
    deltas = np.where(np.arange(150)[:, None, None] < 26, -0.003, held)
    force = _fresh(grasps, deltas, tier)[-25:, :, 4:6].mean(axis=0)
    law = 100 * (0.5 + (1 - kappa) * 4.5) * delta
    np.testing.assert_allclose(force, np.stack([law, law], 1), rtol=0.03)
    np.testing.assert_allclose(force.mean(axis=1), law, rtol=0.01)


@pytest.mark.parametrize(("tier", "tolerance"), [("reference", 0.003), ("fast", 0.015)])
def test_closing_speed_depends_on_b2(tier, tolerance):
    grasps = GraspParameters(0.5, [-13, -9, -6], 0.015, 0, 0.1)
    position = _fresh(grasps, np.full((20, 3, 2), -0.003), tier)[:, :, :2]
    speed = -np.diff(position, axis=0)[-1] / 0.04
    np.testing.assert_allclose(speed, np.array([[18.9], [25.2], [33.7]]) * [[1e-3, 1e-3]], rtol=tolerance)


@TIERS
def test_object_sinks_into_the_floor_by_its_softness(tier):
    simulator = GraspSimulator(3, tier, threads=1)
    simulator.reset(GraspParameters([0, 0.5, 1], -9, 0.02, 0, 0.1))
    _run(simulator, np.zeros((50, 3, 2)))
    depth = [0.05 - simulator.scene(i)[1].body("object").xpos[2] for i in range(3)]
    np.testing.assert_allclose(depth, [1.6e-3, 3.2e-3, 4.5e-3], atol=0.06e-3)
