"""From positions of the motors to the opening between the pads: a law where they slide, else measured in the scene."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from forcegrasp.physics.gripper_parts import Finger, Motor

# Commands between open and closed at which a mechanism is looked at, and the time that each is held. Seconds.
_POINTS, _HOLD_S = 33, 0.4
# Pads further apart than this are no pads of one gripper; nearer than that to their least distance, they meet. Metres.
_FAR_M, _MEET_M = 10.0, 1e-6


@dataclass(frozen=True, eq=False)
class OpeningLaw:
    """The opening, and how the mechanism stands, by position of the motors. All motors are at the same position.

    Shapes: P positions, ascending.
    """

    position: np.ndarray  #: m or rad, ``(P,)``
    opening_m: np.ndarray  #: distance between the pads, ``(P,)``
    travel: np.ndarray  #: metres that each side's pads move outward per unit of the motors, on average, ``(2,)``
    #: How far from the middle of the scene's object each side's pads stand when open, metres, outward: left, right.
    faces_m: tuple[float, float]
    qpos: np.ndarray  #: of the whole scene, ``(P, nq)``; empty where motors slide their own fingers

    def position_at(self, opening_m: np.ndarray | float) -> np.ndarray:
        """Position of the motors at which the pads stand so far apart; the ends of the range beyond it."""
        if len(self.position) == 2:  # a straight line through 0, to the last bit
            return np.asarray(opening_m, float) * (self.position[1] / self.opening_m[1])
        return np.asarray(np.interp(opening_m, self.opening_m, self.position))

    @property
    def reach_m(self) -> tuple[float, float]:
        """How far beyond the middle of the scene's object each side's pads come when closed, metres; left, right."""
        left, right = self.travel * (self.position[-1] - self.position[0]) - self.faces_m
        return float(left), float(right)

    def opening_at(self, position: np.ndarray | float) -> np.ndarray:
        """Distance between the pads at a position of the motors, metres."""
        return np.asarray(np.interp(position, self.position, self.opening_m))


def straight_law(stroke_m: float) -> OpeningLaw:
    """The law where each of two motors slides a finger of its own, metre by metre."""
    ends = np.array([0.0, stroke_m])
    return OpeningLaw(ends, 2 * ends, np.ones(2), (stroke_m, stroke_m), np.empty((2, 0)))


def measure_opening(
    spec: mujoco.MjSpec, motors: Sequence[Motor], fingers: Sequence[Finger], object_geom: str, axis: int
) -> OpeningLaw:
    """The law of a mechanism, read off its scene.

    It is driven from open to closed without the object, and looked at wherever it comes to rest: whatever couples its
    joints (equality constraints, tendons, linkages) is taken as it is.

    Args:
      spec: the scene, which is changed.
      motors: all are given the same commands.
      fingers: left and right.
      object_geom: the object; it is in nobody's way.
      axis: along which the pads open.

    Raises:
      ValueError: if the pads do not come nearer all the way.
    """
    body = spec.geom(object_geom).parent
    body.gravcomp = 1
    for geom in body.geoms:
        geom.contype = geom.conaffinity = 0
    model = spec.compile()
    data = at_the_start(model)
    pads = [pad_geoms(model, finger.body) for finger in fingers]
    scale, zero = command_law(motors, model)
    actuators = [model.actuator(motor.actuator).id for motor in motors]
    joints = [model.joint(motor.joint).qposadr[0] for motor in motors]
    rows: list[list[float]] = []
    faces: list[float] = []
    for command in np.linspace(motors[0].stroke, 0.0, _POINTS):
        data.ctrl[actuators] = command * scale + zero
        mujoco.mj_step(model, data, round(_HOLD_S / model.opt.timestep))
        mujoco.mj_forward(model, data)
        position = float(np.mean([(data.qpos[q] - m.closed) * m.sign for q, m in zip(joints, motors, strict=True)]))
        opening = least_distance(model, data, *pads)
        faces = faces or [least_distance(model, data, side, [model.geom(object_geom).id]) for side in pads]
        rows.append([position, opening, *(data.geom_xpos[geoms, axis].mean() for geoms in pads), *data.qpos])
    table = np.array(rows)[np.argsort([row[0] for row in rows])]
    position, opening, left, right = table[:, :4].T
    # where pads meet, the motor presses on and they stay where they are
    first = max(int((opening > opening.min() + _MEET_M).argmax()) - 1, 0)
    if not ((np.diff(opening[first:]) > 0).all() and (np.diff(position[first:]) > 0).all()):
        backwards = opening[-1] < opening[0]
        told = "; they go apart: are closed and open swapped?" if backwards else ""
        raise ValueError(f"the pads must come nearer all the way from open to closed{told}")
    travel = np.array([left[first] - left[-1], right[-1] - right[first]]) / (position[-1] - position[first])
    half = object_half_width(model, object_geom, axis)
    return OpeningLaw(position[first:], opening[first:], travel, (faces[0] + half, faces[1] + half), table[first:, 4:])


def least_distance(model: mujoco.MjModel, data: mujoco.MjData, some: Iterable[int], others: Iterable[int]) -> float:
    """Between two groups of geoms, metres; negative where they overlap."""
    flags = model.opt.disableflags
    # by libccd distances between boxes and cylinders are millimetres off
    model.opt.disableflags = flags & ~mujoco.mjtDisableBit.mjDSBL_NATIVECCD.value
    found = min(float(mujoco.mj_geomDistance(model, data, i, j, _FAR_M, None)) for i in some for j in others)
    model.opt.disableflags = flags
    return found


def object_half_width(model: mujoco.MjModel, object_geom: str, axis: int) -> float:
    """Radius of the scene's object, metres; half its width if it is a box."""
    geom = model.geom(object_geom)
    return float(geom.size[axis if geom.type[0] == mujoco.mjtGeom.mjGEOM_BOX else 0])


def ground_geoms(model: mujoco.MjModel, object_geom: str) -> np.ndarray:
    """Geoms that never move and may touch the body that a geom is of."""
    fixed = model.body_weldid[model.geom_bodyid] == 0
    own = model.geom_bodyid == model.geom(object_geom).bodyid
    kind, meets = model.geom_contype, model.geom_conaffinity
    touching = ((kind[:, None] & meets[own]) | (meets[:, None] & kind[own])).any(axis=1)
    return np.flatnonzero(fixed & touching)


def pad_geoms(model: mujoco.MjModel, body: str) -> np.ndarray:
    """Geoms of a body and of the bodies on it that can touch something; all of them if none can."""
    inside = np.array([_is_on(model, b, model.body(body).id) for b in model.geom_bodyid])
    solid = inside & ((model.geom_contype != 0) | (model.geom_conaffinity != 0))
    return np.flatnonzero(solid if solid.any() else inside)


def _is_on(model: mujoco.MjModel, body: int, root: int) -> bool:
    while body not in (0, root):
        body = model.body_parentid[body]
    return body == root


def at_the_start(model: mujoco.MjModel) -> mujoco.MjData:
    """A scene's state at its first keyframe, or at MuJoCo's initial positions where it has none."""
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    return data


def command_law(motors: Sequence[Motor], model: mujoco.MjModel) -> tuple[np.ndarray, np.ndarray]:
    """Control signals of the motors: ``position · scale + zero``, each ``(motors,)``.

    A servo of gain g and bias (b₀, b₁) rests where its actuator's length is (g u + b₀) / −b₁.
    """
    scale, zero = np.empty((2, len(motors)))
    data = mujoco.MjData(model)
    for index, motor in enumerate(motors):
        drive = model.actuator(motor.actuator)
        gain, bias, stiffness = drive.gainprm[0], drive.biasprm[0], -drive.biasprm[1]
        of_joint = drive.trntype[0] == mujoco.mjtTrn.mjTRN_JOINT and drive.trnid[0] == model.joint(motor.joint).id
        if of_joint and drive.gear[0] == 1 and math.isclose(gain, stiffness) and bias == 0:
            scale[index], zero[index] = motor.sign, motor.closed  # to the last bit
            continue
        lengths: list[float] = []
        for value in (motor.closed, motor.open):
            _set_mechanism(model, data, motor.joint, value)
            lengths.append(float(data.actuator_length[drive.id]))
        slope = (lengths[1] - lengths[0]) / motor.stroke
        scale[index] = stiffness / gain * slope
        zero[index] = (stiffness * lengths[0] - bias) / gain
    return scale, zero


def _set_mechanism(model: mujoco.MjModel, data: mujoco.MjData, joint: str, value: float) -> None:
    """Puts a motor's joint somewhere, and with it the joints that an equality constraint makes follow it."""
    data.qpos[:] = model.qpos0
    moved = model.joint(joint)
    data.qpos[moved.qposadr[0]] = value
    for equality in range(model.neq):
        if model.eq_type[equality] != mujoco.mjtEq.mjEQ_JOINT:
            continue
        follower, leader = model.eq_obj1id[equality], model.eq_obj2id[equality]
        coefficients = model.eq_data[equality, :5]
        if leader == moved.id:
            offset = value - model.qpos0[moved.qposadr[0]]
            address = model.jnt_qposadr[follower]
            data.qpos[address] = model.qpos0[address] + np.polynomial.polynomial.polyval(offset, coefficients)
        elif follower == moved.id and leader >= 0 and coefficients[1] != 0:
            address = model.jnt_qposadr[leader]
            offset = value - model.qpos0[moved.qposadr[0]]
            data.qpos[address] = model.qpos0[address] + (offset - coefficients[0]) / coefficients[1]
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_tendon(model, data)
    mujoco.mj_transmission(model, data)
