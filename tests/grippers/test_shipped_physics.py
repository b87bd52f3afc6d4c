"""What holds of the physics of every shipped gripper."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from forcegrasp.config import GraspConfig
from forcegrasp.physics import GraspParameters, GraspSampler, GraspSimulator, Gripper
from forcegrasp.physics.plant import Plant, write_base
from forcegrasp.physics.sampling import offset_limits_m
from forcegrasp.physics.simulator import nominal_grasps

N, STEPS = 4, 90


def draw(gripper: Gripper, n: int = N, seed: int = 0) -> GraspParameters:
    return GraspSampler(GraspConfig(), gripper)(np.random.default_rng(seed), np.arange(n))


def close(gripper: Gripper, grasps: GraspParameters, threads: int = 1) -> tuple[GraspSimulator, np.ndarray]:
    """Closes with the largest step; returns readings and truth after each, ``(steps, n, ...)``."""
    simulator, seen = GraspSimulator(len(grasps), "fast", threads, gripper=gripper), []
    simulator.reset(grasps)
    for _ in range(STEPS):
        simulator.step(np.full((len(grasps), len(gripper.motors)), -gripper.max_step))
        truth = (simulator.force, simulator.object_position[:, None])
        seen.append(np.concatenate([simulator.measured_position, simulator.measured_force, *truth], axis=1))
    return simulator, np.array(seen)


@pytest.fixture(scope="module")
def closed(gripper) -> tuple[GraspSimulator, np.ndarray]:
    return close(gripper, draw(gripper))


def test_fingers_close_on_the_object(gripper, closed):
    simulator, seen = closed
    scale = np.asarray(gripper.training.force_scale(simulator.parameters.kappa))[:, None]
    assert np.isfinite(seen).all()
    assert (simulator.force > 0.3 * gripper.training.max_force_n * scale).all()
    assert (simulator.force < 1.5 * gripper.training.max_force_n * scale).all()
    assert (simulator.joint_position < gripper.stroke).all()
    assert (np.abs(simulator.object_position) < gripper.opening.opening_m[-1] / 2).all()


def test_largest_step_holds_the_largest_force(gripper):
    nominal = nominal_grasps(gripper, 1)
    limits = offset_limits_m(gripper, nominal.radius_m, gripper.training.deformation_m)
    grasps = dataclasses.replace(nominal, offset_m=np.mean(limits, axis=0))
    _, seen = close(gripper, grasps)
    readings = seen[-10:, 0, len(gripper.motors) : len(gripper.motors) + len(gripper.forces)]
    largest = gripper.training.max_force_n * float(gripper.training.force_scale(0.5))
    assert readings.mean() == pytest.approx(largest, rel=0.1)


def test_channels_have_names_columns_and_shapes(gripper, closed):
    simulator = closed[0]
    channels = (*gripper.positions, *gripper.commands, *gripper.forces)
    assert len({c.name for c in channels}) == len({c.column for c in channels}) == len(channels)
    for one, kind in ((gripper.positions, "position"), (gripper.commands, "command"), (gripper.forces, "force")):
        suffixes = ("_l", "_r") if len(one) == 2 else ("",)
        assert tuple(c.name for c in one) == tuple(kind + suffix for suffix in suffixes)
        assert {c.unit for c in one} == {"N" if kind == "force" else gripper.unit}
    assert simulator.measured_position.shape == simulator.commanded_position.shape == (N, len(gripper.motors))
    assert simulator.measured_force.shape == (N, len(gripper.forces))
    assert simulator.force.shape == (N, 2)


def test_an_object_further_right_meets_the_right_finger_first(gripper):
    nominal = nominal_grasps(gripper, 2)
    low, high = (
        float(limit) for limit in offset_limits_m(gripper, nominal.radius_m[0], gripper.training.deformation_m)
    )
    middle, quarter = (low + high) / 2, (high - low) / 4
    grasps = dataclasses.replace(nominal, offset_m=np.array([middle - quarter, middle + quarter]))
    simulator, seen = close(gripper, grasps)
    first = (seen[:, :, -3:-1] > 0).argmax(axis=0)  # step at which each side is touched, (grasp, side)
    assert first[0, 0] - first[0, 1] < first[1, 0] - first[1, 1]
    simulator.reset(grasps)
    np.testing.assert_allclose(simulator.object_position, grasps.offset_m, atol=1e-12)


def test_neither_neighbours_nor_threads_change_a_bit(gripper, closed):
    grasps = draw(gripper)
    np.testing.assert_array_equal(close(gripper, grasps, threads=2)[1], closed[1])
    np.testing.assert_array_equal(close(gripper, grasps[2:3])[1], closed[1][:, 2:3])


def test_opening_grows_with_the_position(gripper):
    law = gripper.opening
    assert (np.diff(law.position) > 0).all()
    assert (np.diff(law.opening_m) > 0).all()
    inside = np.linspace(law.opening_m[0], law.opening_m[-1], 7)
    np.testing.assert_allclose(law.opening_at(law.position_at(inside)), inside, atol=1e-9)


def test_forces_begin_where_the_opening_is_the_objects_width(gripper):
    radius = gripper.parameters["radius_m"].nominal
    still = [finger.motor < 0 for finger in gripper.fingers]
    low, high = offset_limits_m(gripper, radius, gripper.training.deformation_m)
    offset = low if still[0] else high if still[1] else 0.0  # against the finger that stands still
    plant, ids = Plant(gripper, 1, threads=1), np.arange(1)
    expected = float(gripper.contact_position(radius))
    start = np.full((1, len(gripper.motors)), expected + 0.05 * gripper.stroke)
    write_base(plant, ids, {"radius_m": np.array([radius])})
    plant.reset(ids, np.array([float(offset)]), start)
    moving = [not s for s in still]
    for step in range(300):
        plant.advance(start - 4e-4 * gripper.stroke * step, 4)
        if (plant.pad_force[0, moving] > 0).all():
            break
    assert (plant.pad_force[0, moving] > 0).all()
    # pads at an angle meet an object beside the line along which their distance is measured
    np.testing.assert_allclose(plant.position[0], expected, atol=(0.01 if gripper.is_direct else 0.05) * gripper.stroke)
