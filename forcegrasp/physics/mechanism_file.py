"""Reads the description of a servo without fingers: a gripper that grasps nothing."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import mujoco

from forcegrasp.errors import closest
from forcegrasp.files.validate import refusal, validate
from forcegrasp.physics.gripper import START_VELOCITY, Gripper
from forcegrasp.physics.gripper_checks import check_write, compile_scene
from forcegrasp.physics.gripper_parts import NO_TRAINING, STEP_SHARE, TYPICAL_STROKE, Motor
from forcegrasp.physics.gripper_schema import MechanismDescription, ScaleEntry

#: Where those are that come with the package, below its descriptions of grippers.
MECHANISMS = "mechanisms"


def load_mechanism(path: Path, raw: dict[str, Any]) -> Gripper:
    """The mechanism of a description that was read.

    Raises:
      ConfigError: if it can't be right; names the file and the line's key.
    """
    said = validate(MechanismDescription, raw, path)
    scale, span = said.scale or ScaleEntry(), sum(entry.span for entry in said.motors) / len(said.motors)
    mechanism = Gripper(
        name=said.name,
        path=path,
        model=path.parent / said.model,
        fast="none",
        motors=tuple(Motor(entry.actuator, entry.joint, 0.0, entry.span, "m") for entry in said.motors),
        fingers=(),
        force="none" if said.effort == "none" else "motor",
        object_joint="",
        object_geom="",
        axis=0,
        period_s=said.period_s,
        max_step=span * STEP_SHARE,
        parameters={name: p.named(name) for name, p in said.parameters.items()},
        training=NO_TRAINING,
        position_scale=scale.position or span / TYPICAL_STROKE,
        force_scale=scale.force or 0.0,  # the scene's to say
        command=said.command,
        unsigned=said.effort == "unsigned",
        settings={name: tuple(writes) for name, writes in said.settings.items()},
    )
    return _in_scene(mechanism)


def _largest_effort(model: mujoco.MjModel, motors: Sequence[Motor]) -> float:
    """The largest effort that the scene lets a motor give, N or N·m, as TIAGo's give 1 N; 1 where none has a limit."""
    drives = [model.actuator(motor.actuator).id for motor in motors]
    limited = [i for i in drives if model.actuator_forcelimited[i] and model.actuator_forcerange[i, 1] > 0]
    return float(model.actuator_forcerange[limited, 1].max()) if limited else 1.0


def _in_scene(mechanism: Gripper) -> Gripper:
    """Checks names and fields against the scene, and takes from it the motors' unit, and effort where none is said."""
    model = compile_scene(mechanism.model)
    names = {
        "joint": [model.joint(i).name for i in range(model.njnt)],
        "actuator": [model.actuator(i).name for i in range(model.nu)],
    }
    for index, motor in enumerate(mechanism.motors):
        for key, known in names.items():
            name = getattr(motor, key)
            if name not in known:
                problem = f"{mechanism.model.name} has no {name!r}{closest(name, known)}"
                raise refusal(mechanism.path, f"motors[{index}].{key}", problem)
            if name in [getattr(other, key) for other in mechanism.motors[:index]]:
                raise refusal(mechanism.path, f"motors[{index}].{key}", f"{name} is there twice")
    joints = [motor.joint for motor in mechanism.motors]
    written = {f"parameters.{name}.writes": p.writes for name, p in mechanism.parameters.items()}
    written |= {f"settings.{name}": writes for name, writes in mechanism.settings.items()}
    for key, writes in written.items():
        for write in writes:
            where = f"{mechanism.path}: {key}: {write.field}"
            check_write(where, model, write, joints)
    if START_VELOCITY in mechanism.parameters and len(joints) > 1:
        raise refusal(mechanism.path, f"parameters.{START_VELOCITY}", "is for mechanisms with one motor; leave it out")
    turns = {model.joint(joint).type[0] == mujoco.mjtJoint.mjJNT_HINGE for joint in joints}
    if len(turns) > 1:
        raise refusal(mechanism.path, "motors", "some of their joints turn and some slide; describe them apart")
    unit = "rad" if turns.pop() else "m"
    motors = tuple(dataclasses.replace(motor, unit=unit) for motor in mechanism.motors)
    force = mechanism.force_scale or _largest_effort(model, motors)
    return dataclasses.replace(mechanism, motors=motors, force_scale=force)
