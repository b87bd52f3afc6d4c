"""The compiled scene, and the fields that a reset writes into it."""

from __future__ import annotations

from importlib.resources import files

import mujoco
import numpy as np
import pytest

from forcegrasp.errors import ConfigError
from forcegrasp.physics import GraspSimulator
from forcegrasp.physics.fast import compile_fast
from forcegrasp.physics.gripper_file import load_gripper
from forcegrasp.physics.plant import Plant

TIERS = ("reference", "fast")
TIAGO = load_gripper("tiago")


def _compile(tier: str, radius: float, rho: float, b2: float) -> mujoco.MjModel:
    """The scene compiled with a grasp's parameters in it from the start."""
    spec = mujoco.MjSpec.from_file(str(files("forcegrasp") / "assets" / "tiago.xml"))
    fast = compile_fast(spec, TIAGO.motors, TIAGO.object_geom, TIAGO.axis) if tier == "fast" else None
    for geom in spec.body("object").geoms:
        geom.size[0], geom.solimp[2] = radius, rho
    for actuator in spec.actuators:
        actuator.biasprm[2] = b2
    model = spec.compile()
    if fast is not None:
        model.dof_damping[:] = fast.dof_damping
    return model


@pytest.mark.parametrize("tier", TIERS)
def test_reset_writes_what_the_compiler_would(draw, tier):
    grasps = draw(24, seed=11)
    simulator = GraspSimulator(len(grasps), tier, threads=1)
    simulator.reset(draw(24, seed=12))
    simulator.reset(grasps)
    rho = TIAGO.training.at("rho_m", grasps.kappa)
    for i in range(len(grasps)):
        compiled = _compile(tier, grasps.radius_m[i], rho[i], grasps.b2[i])
        written, _ = simulator.scene(i)
        names = [name for name in dir(compiled) if isinstance(getattr(compiled, name), np.ndarray)]
        assert {"body_inertia", "geom_rbound", "geom_aabb", "bvh_aabb", "body_invweight0", "dof_invweight0"} <= {*names}
        different = [name for name in names if not np.array_equal(getattr(written, name), getattr(compiled, name))]
        assert not different, grasps.describe(i)


@pytest.mark.parametrize("tier", TIERS)
def test_inverse_weights_know_the_armature(draw, tier):
    # A slide compiled as a "simple" body forgets its armature in set_const: 1 / 0.10998 = 9.09 instead of 4.76.
    simulator = GraspSimulator(3, tier, threads=1)
    simulator.reset(draw(3))
    model, _ = simulator.scene(1)
    assert model.body("object").invweight0[0] == pytest.approx(2.5, rel=1e-9)
    for finger in ("finger_l", "finger_r"):
        assert model.body(finger).invweight0[0] == pytest.approx(1.58745, rel=1e-5)
        assert model.dof_invweight0[model.joint(finger).dofadr[0]] == pytest.approx(4.76236, rel=1e-5)


def test_solver_and_contact_options():
    reference, fast = (TIAGO.compile(tier) for tier in TIERS)
    for model, step in ((reference, 0.002), (fast, 0.008)):
        option = model.opt
        assert option.timestep == step
        assert (option.iterations, option.tolerance, option.ls_iterations, option.ls_tolerance) == (100, 1e-8, 50, 0.01)
        assert option.solver == mujoco.mjtSolver.mjSOL_NEWTON
        assert option.integrator == mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        assert option.cone == mujoco.mjtCone.mjCONE_PYRAMIDAL
        # the collision code of the paper's time
        assert option.disableflags & mujoco.mjtDisableBit.mjDSBL_MULTICCD
        assert option.disableflags & mujoco.mjtDisableBit.mjDSBL_NATIVECCD


@pytest.mark.parametrize("tier", TIERS)
def test_pads_are_where_they_were_measured(tier):
    simulator = GraspSimulator(1, tier, threads=1)
    for _ in range(8):
        simulator.step(np.array([[-0.003, -0.001]]))
    _, data = simulator.scene(0)
    position = simulator.joint_position[0]
    pads = [(0.002, 0.0033, 0.0, 0.017, 0.017)]
    pads += [(x, 0.003, z, 0.0085, 0.0085) for x in (-0.0065, 0.0105) for z in (0.0085, -0.0085)]
    for side, sign, q in (("l", -1, position[0]), ("r", 1, position[1])):
        found = []
        for number in range(1, 6):
            geom = data.geom(f"pad_{side}{number}")
            half = np.abs(geom.xmat.reshape(3, 3)) @ data.model.geom(geom.id).size
            found.append([*(geom.xpos - [0, sign * q, 0.05]), *half])
        expected = [[x, sign * y, z, hx, 0.003, hz] for x, y, z, hx, hz in pads]
        np.testing.assert_allclose(sorted(found), sorted(expected), atol=1e-6)


def test_unknown_tier_is_refused():
    with pytest.raises(ConfigError, match=r"physics\.tier=exact: must be reference or fast"):
        GraspSimulator(1, "exact")


@pytest.mark.parametrize("name", ["tiago", "franka_hand", "robotiq_2f85"])
def test_the_inertia_that_a_motor_moves_is_what_a_push_shows(name):
    """Of both fingers where they are coupled. In a step so short that nothing else acts yet."""
    plant, push = Plant(load_gripper(name), 1, threads=1, step_factor=0.02), 0.02
    speeds = []
    for load in (0.0, -push):
        plant.reset(np.arange(1), np.zeros(1))
        plant.disturb(np.full(1, load), np.ones(1, bool))
        plant.advance(plant.position.copy())
        speeds.append(plant.velocity[0])
    np.testing.assert_allclose(push * plant.dt / (speeds[0] - speeds[1]), plant.inertia[0], rtol=0.01)
