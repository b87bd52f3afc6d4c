"""The description of a gripper as its file is written: every key, what it says, its unit and its default."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Sequence
from typing import Annotated, Literal

from pydantic import AfterValidator, Field, PlainValidator, PositiveFloat, model_validator

from forcegrasp.errors import closest
from forcegrasp.files.validate import Record, counted, must, text, wrong
from forcegrasp.physics.gripper import KNOWN_TO_REPLAY, SIDES, SPECIAL
from forcegrasp.physics.gripper_parts import BaseParameter, FieldWrite

FORMAT, FIRST_FORMAT = "forcegrasp-gripper/2", "forcegrasp-gripper/1"
MECHANISM_FORMAT = "forcegrasp-mechanism/1"
_WRITE = re.compile(r"(-?)((?:actuator|body|dof|geom)_\w+)(?:@([^ @]+))?(?: (\d+))?")


def _field_write(written: object) -> FieldWrite:
    match = _WRITE.fullmatch(str(written))
    if not match:
        raise wrong(f"{str(written)[:40]!r} must look like `actuator_gainprm 0` or `-dof_damping`")
    sign, field, joint, column = match.groups()
    return FieldWrite(field, None if column is None else int(column), -1.0 if sign else 1.0, joint or "")


Writes = list[Annotated[FieldWrite, PlainValidator(_field_write)]]
Name = Annotated[str, text(200)]
Pair = Annotated[tuple[float, float], counted(2, 2, "two numbers in brackets")]
Range = Annotated[Pair, must(lambda ends: ends[0] <= ends[1], "must be [low, high] with low ≤ high")]
_TWO = "two names, [left, right]"
Names = Annotated[tuple[Name, Name], counted(2, 2, _TWO), must(lambda names: names[0] != names[1], f"must be {_TWO}")]


class _Stroke(Record):
    closed: float = Field(description="where the joint is when closed, m or rad")
    open: float = Field(description="where the joint is when open, m or rad")

    @model_validator(mode="after")
    def _must_differ(self) -> _Stroke:
        if self.closed == self.open:
            raise wrong("must differ from closed", "open")
        return self


class MotorEntry(_Stroke):
    """A position servo."""

    joint: Name = Field(description="the joint on which the encoder sits")
    actuator: Name = Field(description="the servo")


class FingerEntry(Record):
    """One side of the grasp."""

    joint: Name | None = Field(default=None, description="the joint that moves the side")
    body: Name | None = Field(default=None, description="the body of its pads, where no joint or several move it")
    force_sensor: Name | None = Field(default=None, description="its sensor")

    @model_validator(mode="after")
    def _moved_or_not(self) -> FingerEntry:
        if (self.joint is None) == (self.body is None):
            raise wrong("needs the joint that moves it, or the body of its pads")
        return self


class FingersEntry(Record):
    """The right one is on the positive side of the axis."""

    left: FingerEntry
    right: FingerEntry


class ObjectEntry(Record):
    """What is grasped."""

    joint: Name = Field(description="the joint on which it moves")
    geom: Name = Field(description="its shape")
    axis: Literal["x", "y", "z"] = Field(description="of the world: the pads close along it")


class ParameterEntry(Record):
    """A number that a fit may change."""

    nominal: float = Field(description="where a fit starts")
    low: float = Field(description="how far a fit may go down")
    high: float = Field(description="how far a fit may go up")
    unit: Name = Field(description="text for tables")
    scope: Literal["gripper", "object", "recording", "grasp"] = Field(description="of what there is one value each")
    writes: Writes = Field(description="fields of MuJoCo's model that take the value", examples=["[dof_damping]"])

    @model_validator(mode="after")
    def _leaves_room(self) -> ParameterEntry:
        if not self.low < self.nominal < self.high:
            bounds = f"low={self.low:g} and high={self.high:g}"
            raise wrong(f"{self.nominal:g} must lie between {bounds}", "nominal")
        return self

    def named(self, name: str) -> BaseParameter:
        """The parameter of this name."""
        return BaseParameter(name, self.nominal, self.low, self.high, self.unit, self.scope, tuple(self.writes))


class ControlEntry(Record):
    period_s: PositiveFloat = Field(default=0.04, description="time between two commands, s")
    max_step: PositiveFloat | None = Field(default=None, description="largest command step, m or rad")


class ScaleEntry(Record):
    """Factors of the sizes at which effects are looked for."""

    position: PositiveFloat | None = Field(default=None, description="of positions")
    force: PositiveFloat | None = Field(default=None, description="of forces")


class TrainingEntry(Record):
    """What a training draws; what is left out follows from the scene."""

    radius_m: Range | None = Field(default=None, description="radii of objects")
    start_radius_m: Range | None = Field(default=None, description="the same at the start of the curriculum")
    offset_m: Range | None = Field(default=None, description="where objects stand along the axis")
    start_offset_m: Range | None = Field(default=None, description="the same at the start of the curriculum")
    deformation_m: float | None = Field(default=None, description="largest deformation, both sides together")
    goal_force_min_n: float | None = Field(default=None, description="smallest goal force")
    max_force_n: float | None = Field(default=None, description="force of a finger at the largest command step")
    softness: dict[str, Pair] = Field(default={}, description="parameter: [hard, soft], its values at κ = 0 and 1")
    servo_gain: Name | None = Field(default=None, description="base parameter that is drawn with every grasp")
    servo_gain_range: Range | None = Field(default=None, description="its range")
    position_std: float | None = Field(default=None, description="noise of the encoders, m or rad")
    force_std_n: float | None = Field(default=None, description="noise of the forces")
    contact_threshold_n: float | None = Field(default=None, description="force above which a finger touches")
    assumed_stiffness: float | None = Field(default=None, description="k of the hand-written controller, N/m or N/rad")
    closing_step: float | None = Field(default=None, description="its command step while it closes, m or rad")


def _complete(parameters: dict[str, ParameterEntry]) -> dict[str, ParameterEntry]:
    for name in SPECIAL:
        if name not in parameters:
            raise wrong(f"missing; every gripper needs {', '.join(SPECIAL)}", name)
    for name, parameter in parameters.items():
        if not parameter.writes and name not in SPECIAL:
            raise wrong("must name a field of the model, such as `dof_damping`", name, "writes")
        if parameter.writes and name in SPECIAL:
            raise wrong(f"must be []; the simulator knows what {name} is", name, "writes")
    if parameters["radius_m"].low <= 0:
        raise wrong("must be positive", "radius_m", "low")
    return parameters


class _Description(Record):
    format: str = Field(description=f"{FORMAT}; {FIRST_FORMAT} is read, too")
    name: Name = Field(description="for titles and messages, and so that models and policies know theirs")
    model: Name = Field(description="the MJCF, beside the description", examples=["my_gripper.xml"])
    fast: Literal["none", "sphere"] = Field(default="none", description="what pads touch in the fast tier")
    object: ObjectEntry = Field(examples=["{joint: object, geom: object, axis: x}"])
    parameters: Annotated[dict[str, ParameterEntry], AfterValidator(_complete)] = Field(
        description="the base model: what a comparison may fit before it looks for missing effects",
        examples=["{radius_m: {nominal: 0.02, low: 0.01, high: 0.04, unit: m, scope: object, writes: []}, …}"],
    )


class Description(_Description):
    """A gripper of one or two motors."""

    motors: Annotated[Sequence[MotorEntry], counted(1, 2, "a list of one motor, or of two (left, right)")] = Field(
        description="one motor, or two: left, right",
        examples=["[{joint: j, actuator: a, closed: 0, open: 0.04}]"],
    )
    fingers: FingersEntry = Field(examples=["{left: {joint: finger_l}, right: {joint: finger_r}}"])
    force: Literal["sensors", "motor", "none"] | None = Field(default=None, description="where forces are read")
    control: ControlEntry | None = None
    scale: ScaleEntry | None = None
    training: TrainingEntry | None = None

    @model_validator(mode="after")
    def _fits_together(self) -> Description:
        known, training = self.parameters, self.training or TrainingEntry()
        for key, names in (("softness", [*training.softness]), ("servo_gain", [training.servo_gain])):
            for name in names:
                if name and name not in known:
                    raise wrong(f"no parameter {name!r}{closest(name, known)}", "training", key)
        if (training.servo_gain is None) != (training.servo_gain_range is None):
            absent = "servo_gain" if training.servo_gain is None else "servo_gain_range"
            raise wrong(
                "missing; a training draws the gain of `servo_gain` from `servo_gain_range`", "training", absent
            )
        has_sensor = bool(self.fingers.left.force_sensor or self.fingers.right.force_sensor)
        if self.force and (self.force == "sensors") != has_sensor:
            raise wrong(f"{self.force}: `sensors` needs a finger with a force_sensor, the others need none", "force")
        return self


class _FirstFingers(_Stroke):
    joints: Names
    actuators: Names
    force_sensors: Names


class FirstDescription(_Description):
    """The first format: two motors on two slides, with a force sensor each."""

    fingers: _FirstFingers

    def as_second(self) -> Description:
        """The same in the second format."""
        old = self.fingers
        motors = [
            MotorEntry(joint=joint, actuator=actuator, closed=old.closed, open=old.open)
            for joint, actuator in zip(old.joints, old.actuators, strict=True)
        ]
        sides = zip(SIDES, old.joints, old.force_sensors, strict=True)
        fingers = {side: FingerEntry(joint=joint, force_sensor=sensor) for side, joint, sensor in sides}
        kept = {key: getattr(self, key) for key in _Description.model_fields}
        scale = ScaleEntry(position=1, force=1)
        return Description(**kept, motors=motors, fingers=FingersEntry(**fingers), scale=scale)


class ServoEntry(Record):
    """A motor of a mechanism, and the joint on which its encoder sits."""

    joint: Name = Field(description="the joint on which the encoder sits")
    actuator: Name = Field(description="the drive")
    span: PositiveFloat = Field(description="how far it usually moves, m or rad; sizes of effects follow from it")


class ServoParameter(ParameterEntry):
    """A number of a mechanism that a fit may change."""

    times: Name | None = Field(default=None, description="setting of a recording that multiplies the value, such as kp")

    def named(self, name: str) -> BaseParameter:
        """The parameter of this name, with the setting that multiplies it."""
        return dataclasses.replace(super().named(name), times=self.times or "")


def _writes_or_is_read(parameters: dict[str, ServoParameter]) -> dict[str, ServoParameter]:
    for name, parameter in parameters.items():
        if not parameter.writes and name not in KNOWN_TO_REPLAY:
            raise wrong("must name a field of the model, such as `dof_damping`", name, "writes")
        if parameter.writes and name in KNOWN_TO_REPLAY:
            raise wrong(f"must be []; the simulator knows what {name} is", name, "writes")
    return parameters


class MechanismDescription(Record):
    """A servo without fingers and object, whose recordings are compared with the model."""

    format: str = Field(description=MECHANISM_FORMAT)
    name: Name = Field(description="for titles and messages, and so that models know theirs")
    model: Name = Field(description="the MJCF, beside the description", examples=["my_servo.xml"])
    motors: Annotated[Sequence[ServoEntry], counted(1, 12, "a list of motors, 12 at most")] = Field(
        examples=["[{joint: j, actuator: a, span: 1}]"]
    )
    command: Literal["position", "effort", "voltage"] = Field(default="position", description="what is commanded")
    effort: Literal["motor", "unsigned", "none"] = Field(default="none", description="how the motor's effort is read")
    period_s: PositiveFloat = Field(default=0.02, description="time between two commands, s")
    scale: ScaleEntry | None = None
    parameters: Annotated[dict[str, ServoParameter], AfterValidator(_writes_or_is_read)] = Field(
        description="the base model"
    )
    settings: dict[str, Writes] = Field(
        default_factory=dict,
        description="numbers of a recording that the scene takes as they are, where recordings have them",
        examples=["{mass: [body_mass]}"],
    )

    @model_validator(mode="after")
    def _settings_are_given(self) -> MechanismDescription:
        for name, writes in self.settings.items():
            if name in self.parameters:
                raise wrong("is among the parameters, too; a number is given or fitted", "settings", name)
            if not writes:
                raise wrong("must name a field of the model, such as `body_mass`", "settings", name)
        return self
