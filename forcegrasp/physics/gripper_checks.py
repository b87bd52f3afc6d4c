"""Checks a description against its scene: names, directions, ranges, and the fields that parameters write."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import mujoco
import numpy as np
from mujoco.batch import MODEL_FIELDS

from forcegrasp.errors import ConfigError, closest
from forcegrasp.files.validate import refusal
from forcegrasp.physics.gripper import SIDES, Gripper
from forcegrasp.physics.gripper_parts import BaseParameter, FieldWrite, Finger, Motor
from forcegrasp.physics.guard import silence_log
from forcegrasp.physics.scene_file import check_scene

#: Physics steps that divide a control step well and keep a simulation affordable. Seconds.
_TIMESTEP_S = (5e-5, 0.02)
_NETFORCE = 3  #: index of reduce="netforce" among a contact sensor's ways to reduce


def compile_scene(path: Path) -> mujoco.MjModel:
    """A scene as it is written, without the sensors that a simulator adds: their names may be what is wrong.

    Raises:
      ConfigError: if it can't be read, or MuJoCo refuses it.
    """
    silence_log()
    check_scene(path)
    try:
        return mujoco.MjSpec.from_file(str(path)).compile()
    except (ValueError, RuntimeError) as error:
        raise refusal(path, "", f"MuJoCo refuses it: {error}") from error


def check_gripper(gripper: Gripper, names: Mapping[str, str]) -> None:
    """Raises ConfigError where a description does not fit its scene.

    Args:
      gripper: as read.
      names: what messages call the parts of its description.
    """
    model = compile_scene(gripper.model)
    low, high = _TIMESTEP_S
    if not low <= model.opt.timestep <= high:  # which may be NaN
        raise ConfigError(f"{gripper.model}: timestep={model.opt.timestep:g}: must lie in [{low:g}, {high:g}] s")
    _check_names(gripper, model, names)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    for side in range(2):
        _check_direction(gripper, model, data, side, names)
    for index, motor in enumerate(gripper.motors):
        _check_motor(gripper, model, motor, index, names)
    for finger in gripper.fingers:
        _check_finger(gripper, model, finger, names)
    if all(finger.motor < 0 for finger in gripper.fingers):
        raise ConfigError(f"{gripper.path}: fingers: none of them moves")
    _check_object(gripper, model, data)
    for parameter in gripper.parameters.values():
        for write in parameter.writes:
            where = f"{gripper.path}: parameters.{parameter.name}.writes: {write.field}"
            check_write(where, model, write, [motor.joint for motor in gripper.motors])
            _check_sign(where, gripper, model, parameter, write)
    try:
        _ = gripper.opening
    except ValueError as error:
        raise ConfigError(f"{gripper.path}: motors: {error}") from error
    gripper.compile("fast")


def _check_names(gripper: Gripper, model: mujoco.MjModel, names: Mapping[str, str]) -> None:
    kinds = mujoco.mjtObj
    fingers = gripper.fingers
    for key, kind, count, wanted in (
        (names["joint"], kinds.mjOBJ_JOINT, model.njnt, [m.joint for m in gripper.motors]),
        ("fingers.joint", kinds.mjOBJ_JOINT, model.njnt, [f.joint for f in fingers if f.joint]),
        ("fingers.body", kinds.mjOBJ_BODY, model.nbody, [f.body for f in fingers if f.body or not f.joint]),
        (names["actuator"], kinds.mjOBJ_ACTUATOR, model.nu, [m.actuator for m in gripper.motors]),
        (names["sensor"], kinds.mjOBJ_SENSOR, model.nsensor, [f.force_sensor for f in fingers if f.force_sensor]),
        ("object.joint", kinds.mjOBJ_JOINT, model.njnt, [gripper.object_joint]),
        ("object.geom", kinds.mjOBJ_GEOM, model.ngeom, [gripper.object_geom]),
    ):
        known = [found for found in (mujoco.mj_id2name(model, kind, index) for index in range(count)) if found]
        for name in wanted:
            if name not in known:
                where = f"{gripper.path}: {key}"
                raise ConfigError(f"{where}: {gripper.model.name} has no {name!r}{closest(name, known)}")


def _check_motor(gripper: Gripper, model: mujoco.MjModel, motor: Motor, index: int, names: Mapping[str, str]) -> None:
    joint, drive = model.joint(motor.joint), model.actuator(motor.actuator)
    whose = f"the {SIDES[index]} finger's" if len(gripper.motors) == 2 else "the motor's"
    where = f"{gripper.path}: {names['joint']}"
    if mujoco.mjtJoint(joint.type[0]) not in (mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE):
        raise ConfigError(f"{where}: {joint.name!r} must be a slide joint or a hinge")
    where = f"{gripper.path}: {names['actuator']}"
    kinds = mujoco.mjtTrn
    of_joint = drive.trntype[0] == kinds.mjTRN_JOINT and drive.trnid[0] == joint.id
    if not of_joint and drive.trntype[0] != kinds.mjTRN_TENDON:
        raise ConfigError(f"{where}: {drive.name!r} must drive {whose} joint {joint.name!r}")
    servo = drive.gainprm[0] > 0 and drive.biasprm[1] < 0
    if of_joint and (drive.gear[0] != 1 or not math.isclose(drive.biasprm[1], -drive.gainprm[0])):
        servo = servo and drive.gear[0] == 1 and len(gripper.motors) == 1
    if not servo:
        raise ConfigError(f"{where}: {drive.name!r} must be a position servo, such as <position kp='100'>")
    side = f"the {SIDES[index]} joint" if len(gripper.motors) == 2 else f"joint {joint.name!r}"
    limits = [(side, bool(model.jnt_limited[joint.id]), joint.range)]
    if of_joint and math.isclose(drive.biasprm[1], -drive.gainprm[0]):
        limited = bool(model.actuator_ctrllimited[drive.id])
        limits.append((side.replace("joint", "actuator", 1), limited, drive.ctrlrange))
    for what, limited, (low, high) in limits:
        for key in ("closed", "open"):
            value = getattr(motor, key)
            if limited and not low - 1e-9 <= value <= high + 1e-9:
                place = f"{gripper.path}: {names[key]}={value:g}"
                raise ConfigError(f"{place}: {what} goes from {low:g} to {high:g} {motor.unit}")


def _check_finger(gripper: Gripper, model: mujoco.MjModel, finger: Finger, names: Mapping[str, str]) -> None:
    if finger.force_sensor and not _reads_a_press(model, model.sensor(finger.force_sensor).id):
        raise ConfigError(
            f"{gripper.path}: {names['sensor']}: {finger.force_sensor!r} must be a touch sensor, or a contact sensor"
            " with data='force' and not reduce='netforce': its numbers are summed, and must be positive when the finger"
            " presses"
        )


def _check_direction(
    gripper: Gripper, model: mujoco.MjModel, data: mujoco.MjData, side: int, names: Mapping[str, str]
) -> None:
    """Refuses a finger that slides the wrong way; of others, the opening that is measured tells."""
    finger, axis = gripper.fingers[side], "xyz"[gripper.axis]
    motor = gripper.motors[max(finger.motor, 0)]
    if motor.joint != finger.joint or motor.unit != "m":
        return
    joint = model.joint(finger.joint)
    if motor.sign * data.xaxis[joint.id][gripper.axis] * (-1, 1)[side] < 0.9:
        raise ConfigError(
            f"{gripper.path}: {names['joint']}: {joint.name!r} must open towards {'-+'[side]}{axis}, as the"
            f" {SIDES[side]} finger: swap left and right, or closed and open, or change object.axis"
        )


def _reads_a_press(model: mujoco.MjModel, sensor: int) -> bool:
    # A contact sensor's integers: bits of `data`, index of `reduce`. A net force has the world's axes and a sign.
    data, reduce, _ = model.sensor_intprm[sensor]
    kind = model.sensor_type[sensor]
    only_force = data == 1 << int(mujoco.mjtConDataField.mjCONDATA_FORCE) and reduce != _NETFORCE
    return kind == mujoco.mjtSensor.mjSENS_TOUCH or (kind == mujoco.mjtSensor.mjSENS_CONTACT and only_force)


def _check_object(gripper: Gripper, model: mujoco.MjModel, data: mujoco.MjData) -> None:
    where, axis = f"{gripper.path}: object", "xyz"[gripper.axis]
    joint, geom = model.joint(gripper.object_joint), model.geom(gripper.object_geom)
    free = joint.type[0] == mujoco.mjtJoint.mjJNT_FREE
    slides = joint.type[0] == mujoco.mjtJoint.mjJNT_SLIDE and data.xaxis[joint.id][gripper.axis] > 0.9
    if not (free or slides):
        raise ConfigError(f"{where}.joint: {joint.name!r} must be a free joint, or a slide joint towards +{axis}")
    if geom.bodyid[0] != joint.bodyid[0]:
        raise ConfigError(f"{where}.geom: {geom.name!r} must be on the body that {joint.name!r} moves")
    shapes = mujoco.mjtGeom
    if shapes(geom.type[0]) not in (shapes.mjGEOM_CYLINDER, shapes.mjGEOM_SPHERE, shapes.mjGEOM_BOX):
        raise ConfigError(f"{where}.geom: {geom.name!r} must be a cylinder, a sphere or a box, to have a radius")


def scene_values(gripper: Gripper, model: mujoco.MjModel, write: FieldWrite) -> np.ndarray:
    """What a parameter is in the scene, by one of the fields that it writes, in its own sign, one-dimensional."""
    rows = {
        "actuator": [model.actuator(motor.actuator).id for motor in gripper.motors],
        "dof": np.flatnonzero(np.asarray(model.dof_jntid) != model.joint(gripper.object_joint).id),
        "geom": [model.geom(gripper.object_geom).id],
    }
    if write.joint:
        own = [motor.joint == write.joint for motor in gripper.motors]
        rows["actuator"] = list(np.compress(own, rows["actuator"]))
        rows["dof"] = model.joint(write.joint).dofadr
    values = np.asarray(getattr(model, write.field))[rows.get(write.field.split("_")[0], [])]
    return write.sign * (values if write.column is None else values[:, write.column])


def _check_sign(
    where: str, gripper: Gripper, model: mujoco.MjModel, parameter: BaseParameter, write: FieldWrite
) -> None:
    """Refuses a parameter that would turn the sign of what it writes: a minus was forgotten, or is too much."""
    values = scene_values(gripper, model, write)
    if parameter.low >= 0 and (values < 0).any():
        column = "" if write.column is None else f" {write.column}"
        minus = "-" if write.sign > 0 else ""
        has, would = write.sign * values.min(), write.sign * parameter.nominal
        raise ConfigError(
            f"{where}{column} is {has:g} in {gripper.model.name}, and {parameter.name} would make it {would:g}:"
            f" write {minus}{write.field}{column}"
        )


def check_write(where: str, model: mujoco.MjModel, write: FieldWrite, joints: Sequence[str]) -> None:
    """Raises ConfigError where a parameter writes what is no field of numbers, no column of it, or of no motor.

    Args:
      where: the file and the key, for messages.
      model: the scene.
      write: what is written.
      joints: of the motors.
    """
    if write.joint and write.field.startswith("geom_"):
        raise ConfigError(f"{where}@{write.joint}: geometries are the object's, of no joint; leave @{write.joint} out")
    if write.joint and write.joint not in joints:
        raise ConfigError(f"{where}@{write.joint}: is no motor's joint{closest(write.joint, joints)}")
    field: np.ndarray | None = getattr(model, write.field, None) if write.field in MODEL_FIELDS else None
    if field is None or not np.issubdtype(np.asarray(field).dtype, np.floating):
        known = [name for name in MODEL_FIELDS if name.startswith(("actuator_", "body_", "dof_", "geom_"))]
        raise ConfigError(f"{where} is no field of numbers in MuJoCo's model{closest(write.field, known)}")
    columns = field.shape[1] if field.ndim == 2 else None
    if (columns is None) != (write.column is None) or (columns is not None and write.column >= columns):
        need = "no column" if columns is None else f"a column from 0 to {columns - 1}"
        raise ConfigError(f"{where} needs {need}")
