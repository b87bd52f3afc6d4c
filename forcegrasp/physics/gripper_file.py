"""Reads the description of a gripper, as YAML; what it does not say follows from the scene."""

# pyright: standard

from __future__ import annotations

import dataclasses
import functools
import math
import re
from pathlib import Path

import mujoco

from forcegrasp.assets import DEFAULT_GRIPPER
from forcegrasp.errors import ConfigError, closest
from forcegrasp.files import plain_yaml
from forcegrasp.files.validate import refusal, validate
from forcegrasp.physics.gripper import Gripper, shipped_folder
from forcegrasp.physics.gripper_checks import check_gripper, compile_scene
from forcegrasp.physics.gripper_defaults import training_of_scene
from forcegrasp.physics.gripper_parts import NO_TRAINING, STEP_SHARE, TYPICAL_FORCE, TYPICAL_STROKE, Finger, Motor
from forcegrasp.physics.gripper_schema import (
    FIRST_FORMAT,
    FORMAT,
    MECHANISM_FORMAT,
    ControlEntry,
    Description,
    FirstDescription,
    ScaleEntry,
)
from forcegrasp.physics.mechanism_file import MECHANISMS, load_mechanism

# What MuJoCo reads.
_SCENES = (".xml", ".mjcf", ".urdf", ".mjb")


def load_gripper(name: str | Path, folder: str | Path = "") -> Gripper:
    """Returns a gripper by name (see :func:`shipped_grippers`) or by the path of its description.

    Args:
      name: what ``gripper:`` says in a measurement set.
      folder: where a relative path starts; the working directory by default.

    Raises:
      ConfigError: if there is no such gripper, or its description can't be right; names the file and the line's key.
    """
    name = str(name)
    if re.fullmatch(r"\w+", name):
        known = shipped_grippers()
        if name in shipped_mechanisms():
            return _load(shipped_folder() / MECHANISMS / f"{name}.yaml")
        if name not in known:
            if Path(folder, name).is_dir():
                raise ConfigError(f"gripper={name}: a folder; give the description in it, such as {name}/mine.yaml")
            raise ConfigError(f"gripper={name}: no such gripper{closest(name, known)}; or give a description's path")
        return _shipped(name)
    return _load(Path(folder) / name)


@functools.cache  # a training asks a dozen times, and the files of the package stay as they are
def _shipped(name: str) -> Gripper:
    return _load(shipped_folder() / f"{name}.yaml")


def default_gripper() -> Gripper:
    """The gripper that is simulated where no other is named: the paper's."""
    return load_gripper(DEFAULT_GRIPPER)


def shipped_grippers() -> list[str]:
    """Names of the grippers that come with the package."""
    return sorted(p.stem for p in shipped_folder().glob("*.yaml") if p.with_suffix(".xml").is_file())


def shipped_mechanisms() -> list[str]:
    """Names of the mechanisms without fingers that come with the package."""
    return sorted(p.stem for p in (shipped_folder() / MECHANISMS).glob("*.yaml"))


def _load(path: Path) -> Gripper:
    if path.suffix.lower() in _SCENES:
        raise refusal(path, "", f"a scene; give the description that names it (format: {FORMAT})")
    try:
        raw = plain_yaml.load(path)
    except (OSError, plain_yaml.PlainYamlError) as error:
        why = getattr(error, "strerror", None) or str(error)
        raise refusal(path, "", f"could not read the gripper description: {why}") from error
    written = raw.get("format", "missing") if isinstance(raw, dict) else FORMAT
    if written == MECHANISM_FORMAT:
        return load_mechanism(path, raw)
    if written not in (FORMAT, FIRST_FORMAT):
        also = "missing; " if written == "missing" else ""
        raise refusal(path, "format", f"{also}must be {FORMAT}; {FIRST_FORMAT} is read, too")
    if written == FIRST_FORMAT:
        description, names = validate(FirstDescription, raw, path).as_second(), _FIRST_NAMES
    else:
        description, names = validate(Description, raw, path), _NAMES
    gripper = _in_scene(_gripper(path, description))
    check_gripper(gripper, names)
    given = description.training.model_dump(exclude_none=True, exclude_unset=True) if description.training else {}
    training = training_of_scene(gripper, given)
    force = gripper.force_scale or TYPICAL_FORCE * training.max_force_n
    return dataclasses.replace(gripper, training=training, force_scale=force)


#: What messages call the parts of a description.
_NAMES = {"joint": "motors.joint", "actuator": "motors.actuator", "closed": "motors.closed", "open": "motors.open",
          "sensor": "fingers.force_sensor"}  # fmt: skip
_FIRST_NAMES = {"joint": "fingers.joints", "actuator": "fingers.actuators", "closed": "fingers.closed",
                "open": "fingers.open", "sensor": "fingers.force_sensors"}  # fmt: skip


def _gripper(path: Path, said: Description) -> Gripper:
    """A gripper as described; units of motors and bodies of fingers are the scene's to say."""
    strokes = [abs(motor.open - motor.closed) for motor in said.motors]
    if not math.isclose(strokes[0], strokes[-1]):
        raise refusal(path, "motors", "open and closed must be as far apart in both")
    fingers, control, scale = said.fingers, said.control or ControlEntry(), said.scale or ScaleEntry()
    sides = [Finger(f.body or "", f.joint or "", -1, f.force_sensor or "") for f in (fingers.left, fingers.right)]
    return Gripper(
        name=said.name,
        path=path,
        model=path.parent / said.model,
        fast=said.fast,
        motors=tuple(Motor(m.actuator, m.joint, m.closed, m.open, "m") for m in said.motors),
        fingers=(sides[0], sides[1]),
        force=said.force or ("sensors" if any(side.force_sensor for side in sides) else "none"),
        object_joint=said.object.joint,
        object_geom=said.object.geom,
        axis="xyz".index(said.object.axis),
        period_s=control.period_s,
        max_step=control.max_step or strokes[0] * STEP_SHARE,
        parameters={name: p.named(name) for name, p in said.parameters.items()},
        training=NO_TRAINING,
        position_scale=scale.position or strokes[0] / TYPICAL_STROKE,
        force_scale=scale.force or 0.0,  # follows from the scene
    )


def _in_scene(gripper: Gripper) -> Gripper:
    """Fills in what names of the scene stand for: units of motors, bodies of fingers, and what moves them."""
    model = compile_scene(gripper.model)
    joints = {model.joint(i).name: i for i in range(model.njnt)}
    hinge = mujoco.mjtJoint.mjJNT_HINGE
    units = ["rad" if m.joint in joints and model.jnt_type[joints[m.joint]] == hinge else "m" for m in gripper.motors]
    motors = tuple(dataclasses.replace(m, unit=u) for m, u in zip(gripper.motors, units, strict=True))
    fingers = []
    for side, finger in enumerate(gripper.fingers):
        if finger.joint:
            if finger.joint not in joints:
                fingers.append(finger)
                continue
            body = int(model.jnt_bodyid[joints[finger.joint]])
            finger = dataclasses.replace(finger, body=model.body(body).name)
        else:
            found = [i for i in range(model.nbody) if model.body(i).name == finger.body]
            body = found[0] if found else 0
        moved_by = _joints_below(model, body)
        own = [i for i, m in enumerate(gripper.motors) if joints.get(m.joint) in moved_by]
        motor = own[0] if own else (min(side, len(motors) - 1) if moved_by else -1)
        joint = model.joint(moved_by[0]).name if moved_by else ""
        fingers.append(dataclasses.replace(finger, joint=finger.joint or joint, motor=motor))
    return dataclasses.replace(gripper, motors=motors, fingers=(fingers[0], fingers[1]))


def _joints_below(model: mujoco.MjModel, body: int) -> list[int]:
    """Joints between a body and the world, the nearest first."""
    found: list[int] = []
    while body:
        first = model.body_jntadr[body]
        found += range(first, first + model.body_jntnum[body]) if first >= 0 else []
        body = model.body_parentid[body]
    return found
