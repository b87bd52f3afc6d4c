"""The fast tier: the same grasp with a simpler contact shape and larger steps, within the sensor's noise.

The pads touch a sphere in the object's place, which spares the collision of cylinder and box that takes half of the
engine's time. The step is up to four times as large, and what a larger step does to the fingers is taken back.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence

import mujoco
import numpy as np

from forcegrasp.physics.gripper_parts import Motor
from forcegrasp.physics.opening import at_the_start, command_law

#: Name of the sphere, after that of the object's geom.
SPHERE = "{}_pads"
# Collision bits: 1 is the pads' contact, 2 that of the ground.
_PADS, _GROUND = 1, 2
# The step is doubled while (step · servo's frequency)² stays below this, and contacts keep their stiffness, for which
# MuJoCo wants two steps within their time constant.
_LARGEST_PHASE = 0.1
# An object has come to rest if it is slower than this after so long. m/s and seconds.
_AT_REST, _SETTLING_S = 1e-3, 0.5
# A grasp goes the same way where motors are never apart by this share of the way that they go. It closes within so
# many seconds, presses for as long and opens.
_SAME_WAY, _CLOSES_S = 0.02, 0.5


def compile_fast(
    spec: mujoco.MjSpec, motors: Sequence[Motor], object_geom: str, axis: int, largest: int = 4
) -> mujoco.MjModel:
    """Returns the fast model of a scene, whose spec is changed.

    Args:
      spec: the scene.
      motors: its servos.
      object_geom: the object.
      axis: of the grasp: 0, 1, 2 for x, y, z.
      largest: how many times as large the step may be, a power of 2.

    Raises:
      ValueError: if MuJoCo refuses the scene.
    """
    _touch_a_sphere(spec, spec.compile(), object_geom, axis)
    model = _take_larger_steps(spec.compile(), motors, object_geom, largest)
    # To look for contacts that can be solved apart takes longer than to solve those of one gripper together.
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_ISLAND
    return model


def with_larger_steps(model: mujoco.MjModel, motors: Sequence[Motor], object_geom: str, largest: int) -> mujoco.MjModel:
    """Returns a scene's model with larger steps, or as it is where a grasp would go another way with them.

    Args:
      model: the scene's.
      motors, object_geom, largest: as for :func:`compile_fast`.
    """
    times, places = _places_in_a_grasp(model, motors)
    while largest > 1:
        larger = _take_larger_steps(copy.copy(model), motors, object_geom, largest)
        seen, others = _places_in_a_grasp(larger, motors)
        same = np.stack([np.interp(times, seen, others[:, motor]) for motor in range(len(motors))], axis=1)
        if np.abs(same - places).max() < _SAME_WAY * np.ptp(places):
            return larger
        largest //= 2
    return model


def _places_in_a_grasp(model: mujoco.MjModel, motors: Sequence[Motor]) -> tuple[np.ndarray, np.ndarray]:
    """Times ``(steps,)`` and positions of the motors, m or rad, ``(steps, motors)``, of a grasp that lets go again."""
    scale, zero = command_law(motors, model)
    drives = [model.actuator(motor.actuator).id for motor in motors]
    joints = [model.joint(motor.joint).qposadr[0] for motor in motors]
    stroke = np.array([motor.stroke for motor in motors])
    data = at_the_start(model)
    starts = model.opt.timestep * np.arange(round(3 * _CLOSES_S / model.opt.timestep))
    places = np.empty((len(starts), len(motors)))
    for step, opened in enumerate(np.clip(abs(starts / _CLOSES_S - 1.5) - 0.5, 0, 1)):
        data.ctrl[drives] = opened * stroke * scale + zero
        mujoco.mj_step(model, data)
        places[step] = data.qpos[joints]
    return starts + model.opt.timestep, places


def _take_larger_steps(
    model: mujoco.MjModel, motors: Sequence[Motor], object_geom: str, largest: int
) -> mujoco.MjModel:
    """Returns the model, changed to take the largest steps at which its servos and contacts are resolved."""
    drives = [model.actuator(motor.actuator).id for motor in motors]
    dofs = [model.joint(motor.joint).dofadr[0] for motor in motors]
    stiffness = model.actuator_gainprm[drives, 0]
    factor = _step_factor(model, object_geom, stiffness / _moved_inertia(model, dofs), largest)
    larger = (factor - 1) * model.opt.timestep
    model.opt.timestep *= factor
    # A step applies a command to all of it, on average half a step early. What the servo gains by that, stiffness
    # times half a step, is its damping's to lose.
    model.dof_damping[dofs] += stiffness * larger / 2
    return model


def _moved_inertia(model: mujoco.MjModel, dofs: Sequence[int]) -> np.ndarray:
    """Inertia that each motor moves, that of joints coupled to it included, kg or kg·m².

    It is what a unit force divides by to accelerate, at the first keyframe, where nothing else acts.
    """
    model = copy.copy(model)
    model.opt.gravity[:] = 0
    bits = mujoco.mjtDisableBit
    for other in bits.mjDSBL_CONTACT, bits.mjDSBL_LIMIT, bits.mjDSBL_FRICTIONLOSS, bits.mjDSBL_ACTUATION:
        model.opt.disableflags |= other
    data = at_the_start(model)
    mujoco.mj_forward(model, data)
    at_rest = data.qacc.copy()  # springs may act
    inertia = np.empty(len(dofs))
    for index, dof in enumerate(dofs):
        data.qfrc_applied[:] = 0
        data.qfrc_applied[dof] = 1
        mujoco.mj_forward(model, data)
        inertia[index] = 1 / (data.qacc[dof] - at_rest[dof])
    return inertia


def _step_factor(model: mujoco.MjModel, object_geom: str, frequency_squared: np.ndarray, largest: int) -> int:
    constant, _ = model.geom(object_geom).solref
    factor = largest
    while factor > 1:
        step = factor * model.opt.timestep
        if (step**2 * frequency_squared).max() <= _LARGEST_PHASE and (constant <= 0 or 2 * step <= constant):
            break
        factor //= 2
    return factor


def _touch_a_sphere(spec: mujoco.MjSpec, reference: mujoco.MjModel, object_geom: str, axis: int) -> None:
    real = spec.geom(object_geom)
    for ground in (real, *spec.worldbody.geoms):
        ground.contype, ground.conaffinity = _GROUND, _GROUND
    sphere = real.parent.add_geom(
        name=SPHERE.format(object_geom),
        type=mujoco.mjtGeom.mjGEOM_SPHERE,
        size=[real.size[axis if real.type == mujoco.mjtGeom.mjGEOM_BOX else 0], 0, 0],
        pos=real.pos - _sinks(reference, object_geom),
        mass=0,
        contype=_PADS,
        conaffinity=_PADS,
        rgba=[0, 0, 0, 0],
    )
    for name in ("condim", "priority", "friction", "solref", "solimp"):
        setattr(sphere, name, getattr(real, name))


def _sinks(reference: mujoco.MjModel, object_geom: str) -> np.ndarray:
    """How far an object sinks into soft ground, in its own frame, metres, ``(3,)``; 0 if it doesn't come to rest.

    Along a cylinder that makes no difference to the pads; a sphere has to stay between them.
    """
    data = at_the_start(reference)
    mujoco.mj_forward(reference, data)
    body = reference.geom(object_geom).bodyid[0]
    before, turned = data.xpos[body].copy(), data.xmat[body].reshape(3, 3).copy()
    mujoco.mj_step(reference, data, round(_SETTLING_S / reference.opt.timestep))
    first, count = reference.body_dofadr[body], reference.body_dofnum[body]
    if np.abs(data.qvel[first : first + count]).max() > _AT_REST:
        return np.zeros(3)
    return turned.T @ (data.xpos[body] - before)
