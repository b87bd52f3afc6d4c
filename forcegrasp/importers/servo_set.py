"""Recordings of a servo as a measurement set of a mechanism."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from forcegrasp.errors import ConfigError, MeasurementError
from forcegrasp.importers.recording import Recording
from forcegrasp.measure.schema import MeasuredGrasp, MeasurementSet, columns_of, fingerprint_of_set
from forcegrasp.measure.servo_set import needed_settings, settings_of
from forcegrasp.physics.gripper import EFFORT_SCALE, Gripper
from forcegrasp.short_repr import counted


def as_set(recordings: Sequence[Recording], mechanism: Gripper, source: str, license: str) -> MeasurementSet:
    """The set that recordings make.

    Args:
      recordings: each of as many joints as the mechanism has motors: of the same names, or in their order.
      mechanism: that they are of.
      source: where they come from.
      license: on what terms they may be used.

    Raises:
      ConfigError: if the mechanism has fingers.
      MeasurementError: if a recording has another number of joints, another command, or lacks a setting.
    """
    if not mechanism.is_servo:
        raise ConfigError(f"mechanism={mechanism.name}: has fingers; write its measurements as a set of grasps")
    found = tuple(_recording(one, mechanism) for one in recordings)
    names = [one.name for one in found]
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise MeasurementError(f"{twice[0]}: two recordings have this name; import them one by one")
    name = mechanism.name_or_path
    return MeasurementSet(
        path=Path(source), name=Path(source).name, gripper=name, source=source, license=license, position_std_m=None,
        force_std_n=None, grasps=found, fingerprint=fingerprint_of_set(name, None, None, found), kind="servo",
    )  # fmt: skip


def _recording(one: Recording, mechanism: Gripper) -> MeasuredGrasp:
    joints = [motor.joint for motor in mechanism.motors]
    if len(one.joints) != len(joints):
        choice = ",".join(one.joints[-len(joints) :])
        raise MeasurementError(
            f"{one.name}: has {counted(len(one.joints), 'joint')}, {', '.join(one.joints)}, and {mechanism.name}"
            f" {counted(len(joints), 'motor')}; choose with 'joints=[{choice}]'"
        )
    if set(one.joints) == set(joints):
        one = one.of_joints(joints)
    if one.load is not None and len(joints) > 1:
        raise MeasurementError(f"{one.name}: a load from outside is of a single joint; leave it out of the map")
    if one.command_unit != {"position": "", "effort": mechanism.effort_unit, "voltage": "V"}[mechanism.command]:
        holds = f"in {one.command_unit}" if one.command_unit else "positions"
        raise MeasurementError(
            f"{one.name}: commands are {holds}; {mechanism.name} takes {mechanism.commands[0].unit}: choose another"
            " mechanism"
        )
    if missing := [name for name in needed_settings(mechanism) if name not in one.settings]:
        raise MeasurementError(f"{one.name}: does not say {', '.join(missing)}, which {mechanism.name} needs")
    effort = np.empty((len(one.time_s), 0))
    if mechanism.forces:
        if one.effort is None:
            raise MeasurementError(f"{one.name}: has no effort, which {mechanism.name} reads; say `effort: none` there")
        if not one.effort_signed and not mechanism.unsigned:
            raise MeasurementError(
                f"{one.name}: its efforts are without a sign; {mechanism.name} reads them with one: say"
                " `effort: unsigned` or `none` there"
            )
        if one.effort_unit != mechanism.effort_unit and EFFORT_SCALE not in mechanism.parameters:
            raise MeasurementError(
                f"{one.name}: its efforts are in {one.effort_unit}; {mechanism.name} reads {mechanism.effort_unit}: say"
                f" `effort: none` there, or give it the parameter {EFFORT_SCALE}"
            )
        effort = np.abs(one.effort) if mechanism.unsigned else one.effort
    return MeasuredGrasp(
        name=one.name, object="", session=one.name, radius_m=None, offset_m=None, split=None, time_s=one.time_s,
        command_m=one.command, position_m=one.position, force_n=effort, object_m=None, columns=columns_of(mechanism),
        settings={name: one.settings[name] for name in settings_of(mechanism) if name in one.settings},
        enabled=one.enabled, load=one.load,
    )  # fmt: skip
