"""MuJoCo Warp's grasps against MuJoCo's: on Warp's CPU backend, which runs the kernels and the graph of a GPU's."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from forcegrasp.errors import PhysicsError
from forcegrasp.gpu.simulator import WarpGraspSimulator
from forcegrasp.physics import GraspParameters, GraspSimulator

pytestmark = pytest.mark.usefixtures("warp")
FIELDS = ("geom_size", "geom_solimp", "geom_aabb", "geom_rbound", "body_inertia", "actuator_biasprm", "dof_invweight0")


@pytest.fixture(scope="module")
def fast() -> WarpGraspSimulator:
    return WarpGraspSimulator(6, "fast")


def deltas(steps: int, n: int, seed: int = 0) -> np.ndarray:
    """Closes, each finger at its own speed, and opens again, metres, ``(steps, n, 2)``."""
    speed = 0.6 + 0.4 * np.random.default_rng(seed).random((1, n, 2))
    wave = np.where(np.arange(steps) < 0.8 * steps, -1.0, 1.0)
    return np.float32(0.003 * speed * wave[:, None, None])


def play(simulator: GraspSimulator | WarpGraspSimulator, actions: np.ndarray) -> dict[str, np.ndarray]:
    """What happened, each ``(steps, n, ...)``."""
    seen = {"joint_position": [], "force": [], "object_position": [], "object_speed": [], "commanded_position": []}
    for action in actions:
        warp = isinstance(simulator, WarpGraspSimulator)
        simulator.step(torch.from_numpy(action) if warp else action.astype(np.float64))
        for name, values in seen.items():
            values.append(torch.as_tensor(getattr(simulator, name)).double().numpy().copy())
    return {name: np.stack(values) for name, values in seen.items()}


def deviations(simulator: WarpGraspSimulator, tier: str, grasps: GraspParameters, steps: int) -> dict[str, np.ndarray]:
    mujoco = GraspSimulator(len(grasps), tier, threads=1)
    for one in (simulator, mujoco):
        one.reset(grasps)
    actions = deltas(steps, len(grasps))
    own, known = play(simulator, actions), play(mujoco, actions)
    assert (known["force"] > 0.02).any(axis=0).all()  # every finger presses
    return {name: np.abs(own[name] - known[name]) for name in own}


def test_fast_tier_is_mujocos_to_rounding(fast, draw):
    # Measured over 64 grasps of 150 steps: mean force 3 µN, at worst 1.3 mN, finger 1 µm, object 5 µm.
    off = deviations(fast, "fast", draw(6, seed=5, radius_m=[0.025, 0.035], offset_m=[-0.005, 0.005]), 60)
    assert off["force"].mean() <= 3e-5
    assert off["force"].max() <= 3e-3
    assert off["joint_position"].max() <= 3e-6
    assert off["commanded_position"].max() <= 3e-6
    assert off["object_position"].max() <= 1e-5
    assert off["object_speed"].max() <= 1e-5


def test_reference_tier_differs_by_its_collision_of_cylinder_and_box(draw):
    # Measured over 64 grasps of 150 steps: mean force 0.7 mN, at worst 17 mN, finger 0.06 mm, object 0.03 mm.
    grasps = draw(2, seed=5, radius_m=[0.03, 0.035], offset_m=[-0.003, 0.003])
    off = deviations(WarpGraspSimulator(2, "reference"), "reference", grasps, 50)
    assert off["force"].mean() <= 3e-3
    assert off["joint_position"].max() <= 0.1e-3
    assert off["object_position"].max() <= 0.1e-3


def test_an_object_at_rest_does_not_rock(fast):
    """In float32 a tilt must not vanish: a held object's forces stay put."""
    fast.reset(GraspParameters([0.0, 0.2, 0.4, 0.6, 0.8, 1.0], -9.0, 0.03, 0.0, 0.1))
    closing = torch.full((6, 2), -0.003)
    for _ in range(50):
        fast.step(closing)
    forces = []
    for _ in range(20):
        fast.step(closing)
        forces.append(fast.force)
    assert torch.stack(forces).std(0).max() <= 2e-3


def test_every_grasp_has_the_model_that_mujoco_gives_it(fast, draw):
    grasps = draw(6, seed=1)
    fast.reset(grasps)
    mujoco = GraspSimulator(6, "fast", threads=1)
    mujoco.reset(grasps)
    for name in FIELDS:
        own = getattr(fast._scene._model, name).numpy()
        known = np.asarray(mujoco.plant.batch.expand(name)).reshape(own.shape)
        if name == "geom_aabb":  # MuJoCo's plane has a huge one in its way
            own, known = own[:, 1:], known[:, 1:]
        np.testing.assert_allclose(own, known, rtol=1e-6, atol=1e-9, err_msg=name)


def test_partial_reset_leaves_the_others_alone(fast, draw):
    grasps, actions = draw(6, seed=2, radius_m=[0.03, 0.035]), deltas(40, 6)
    fast.reset(grasps)
    whole = play(fast, actions)
    fast.reset(grasps)
    play(fast, actions[:20])
    force, position = fast.force, fast.joint_position
    others = draw(2, seed=3, radius_m=[0.03, 0.035])
    fast.reset(others, np.array([1, 4]))
    kept = [0, 2, 3, 5]
    assert torch.equal(fast.force[kept], force[kept])
    assert torch.equal(fast.joint_position[kept], position[kept])
    assert fast.steps.tolist() == [20, 0, 20, 20, 0, 20]
    assert not fast.force[[1, 4]].any()
    assert (fast.joint_position[[1, 4]] == np.float32(0.045)).all()
    np.testing.assert_allclose(fast.object_position[[1, 4]], others.offset_m, rtol=1e-6)
    rest = play(fast, actions[20:])
    for name, values in rest.items():
        np.testing.assert_array_equal(values[:, kept], whole[name][20:, kept], err_msg=name)


def test_a_grasp_does_not_depend_on_what_its_slot_held_before(fast, draw):
    grasps, actions = draw(6, seed=4, radius_m=[0.03, 0.035]), deltas(30, 6)
    fast.reset(grasps)
    first = play(fast, actions)
    fast.reset(draw(6, seed=5))
    play(fast, actions[:10])
    fast.reset(grasps)
    again = play(fast, actions)
    for name in first:
        np.testing.assert_array_equal(first[name], again[name], err_msg=name)


def test_recorded_steps_are_the_plain_ones(fast, draw):
    import mujoco_warp
    import warp

    grasps, actions = draw(6, seed=6, radius_m=[0.033, 0.035]), deltas(20, 6)
    fast.reset(grasps)
    recorded = play(fast, actions)
    fast.reset(grasps)
    scene = fast._scene
    steps = round(0.04 / scene._host.opt.timestep)

    def plain(_) -> None:
        for _ in range(steps):
            mujoco_warp.step(scene._model, scene._data)

    with pytest.MonkeyPatch.context() as patch, warp.ScopedDevice("cpu"):
        patch.setattr(warp, "capture_launch", plain)
        stepped = play(fast, actions)
    for name in recorded:
        np.testing.assert_array_equal(stepped[name], recorded[name], err_msg=name)


def test_what_was_read_stays(fast, draw):
    fast.reset(draw(6, seed=7))
    fast.step(torch.full((6, 2), -0.003))
    names = ("joint_position", "force", "object_position", "object_speed", "commanded_position", "steps")
    read = {name: getattr(fast, name) for name in names}
    copies = {name: values.clone() for name, values in read.items()}
    fast.reset(draw(6, seed=8))
    fast.step(torch.full((6, 2), -0.001))
    assert all(torch.equal(read[name], copies[name]) for name in names)


@pytest.mark.parametrize("name", ["qpos", "qvel"])
def test_divergence_is_told(name, draw, fast):
    fast.reset(draw(6, seed=9))
    fast._scene._state[name][3] = torch.nan
    with pytest.raises(PhysicsError, match=r"grasp 3 diverged at control step 0 \(bad positions\): kappa="):
        fast.command(torch.full((6, 2), 0.04))
    fast.reset(draw(6, seed=9))
    fast.step(torch.full((6, 2), -0.003))  # sound again


def test_a_command_that_is_no_number_is_told(draw, fast):
    fast.reset(draw(6, seed=9))
    with pytest.raises(PhysicsError, match="grasp 2 diverged"):
        fast.step(torch.zeros(6, 2).index_fill(0, torch.tensor(2), torch.nan))
    fast.reset(draw(6, seed=9))


def test_as_many_parameters_as_slots(fast, draw):
    with pytest.raises(ValueError, match="parameters of 2 grasps for 6 slots"):
        fast.reset(draw(2))
    fast.reset(draw(2)[np.arange(0)], np.arange(0))
