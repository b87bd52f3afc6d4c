"""Reads the description of a servo without fingers: a gripper that grasps nothing."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import mujoco

from forcegrasp.errors import closest
from forcegrasp.files.validate import refusal, validate
from forcegrasp.physics.gripper import Gripper
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
    (entry,), scale = said.motors, said.scale or ScaleEntry()
    motor = Motor(entry.actuator, entry.joint, 0.0, entry.span, "m")
    mechanism = Gripper(
        name=said.name,
        path=path,
        model=path.parent / said.model,
        fast="none",
        motors=(motor,),
        fingers=(),
        force="motor" if said.effort == "motor" else "none",
        object_joint="",
        object_geom="",
        axis=0,
        period_s=said.period_s,
        max_step=entry.span * STEP_SHARE,
        parameters={name: p.named(name) for name, p in said.parameters.items()},
        training=NO_TRAINING,
        position_scale=scale.position or entry.span / TYPICAL_STROKE,
        force_scale=scale.force,
        command=said.command,
    )
    return _in_scene(mechanism)


def _in_scene(mechanism: Gripper) -> Gripper:
    """Checks names and fields against the scene, and takes the unit of the motor from it."""
    model = compile_scene(mechanism.model)
    (motor,) = mechanism.motors
    for key, name, known in (
        ("motors.joint", motor.joint, [model.joint(i).name for i in range(model.njnt)]),
        ("motors.actuator", motor.actuator, [model.actuator(i).name for i in range(model.nu)]),
    ):
        if name not in known:
            raise refusal(mechanism.path, key, f"{mechanism.model.name} has no {name!r}{closest(name, known)}")
    for parameter in mechanism.parameters.values():
        for write in parameter.writes:
            check_write(f"{mechanism.path}: parameters.{parameter.name}.writes: {write.field}", model, write)
    turns = model.joint(motor.joint).type[0] == mujoco.mjtJoint.mjJNT_HINGE
    return dataclasses.replace(mechanism, motors=(dataclasses.replace(motor, unit="rad" if turns else "m"),))
