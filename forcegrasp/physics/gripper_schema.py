"""The description of a gripper as its file is written: every key, what it says, its unit and its default."""

from __future__ import annotations

import re
from dataclasses import fields
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, PlainValidator, PositiveFloat, create_model, model_validator

from forcegrasp.errors import closest
from forcegrasp.files.validate import Record, counted, text, wrong
from forcegrasp.physics.gripper import SIDES, SPECIAL
from forcegrasp.physics.gripper_parts import FieldWrite, Training

FORMAT, FIRST_FORMAT = "forcegrasp-gripper/2", "forcegrasp-gripper/1"
_WRITE = re.compile(r"(-?)((?:actuator|dof|geom)_\w+)(?: (\d+))?")


def _field_write(written: object) -> FieldWrite:
    match = _WRITE.fullmatch(str(written))
    if not match:
        raise wrong(f"{str(written)[:40]!r} must look like `actuator_gainprm 0` or `-dof_damping`")
    sign, field, column = match.groups()
    return FieldWrite(field, None if column is None else int(column), -1.0 if sign else 1.0)


def _ordered(ends: tuple[float, float]) -> tuple[float, float]:
    if ends[0] > ends[1]:
        raise wrong("must be [low, high] with low ≤ high")
    return ends


Name = Annotated[str, text(200)]
Pair = Annotated[tuple[float, float], counted(2, 2, "two numbers in brackets")]
Range = Annotated[Pair, AfterValidator(_ordered)]
Names = Annotated[tuple[Name, Name], counted(2, 2, "two names, [left, right]")]


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

    joint: Name | None = Field(None, description="the joint that moves the side")
    body: Name | None = Field(None, description="the body of its pads, where no joint or several move it")
    force_sensor: Name | None = Field(None, description="its sensor")

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
    scope: Literal["gripper", "object", "grasp"] = Field(description="of what there is one value each")
    writes: list[Annotated[FieldWrite, PlainValidator(_field_write)]] = Field(
        description="fields of MuJoCo's model that take the value", examples=["[dof_damping]"]
    )

    @model_validator(mode="after")
    def _leaves_room(self) -> ParameterEntry:
        if not self.low < self.nominal < self.high:
            bounds = f"low={self.low:g} and high={self.high:g}"
            raise wrong(f"{self.nominal:g} must lie between {bounds}", "nominal")
        return self


class ControlEntry(Record):
    period_s: PositiveFloat = Field(0.04, description="time between two commands, s")
    max_step: PositiveFloat | None = Field(None, description="largest command step, m or rad")


class ScaleEntry(Record):
    """Factors of the sizes at which effects are looked for."""

    position: PositiveFloat | None = Field(None, description="of positions")
    force: PositiveFloat = Field(1.0, description="of forces")


#: What a training draws; what is left out follows from the scene.
_TRAINING_TYPES = {
    "tuple[float, float]": Range,
    "dict[str, tuple[float, float]]": dict[str, Pair],
    "str": Name,
    "float": float,
}
_TRAINING_KEYS: dict[str, Any] = {f.name: (_TRAINING_TYPES[str(f.type)] | None, None) for f in fields(Training)}
TrainingEntry = create_model("TrainingEntry", __base__=Record, **_TRAINING_KEYS)


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
    model: Name = Field(description="the MJCF, beside the description")
    fast: Literal["none", "sphere"] = Field("none", description="what pads touch in the fast tier")
    object: ObjectEntry
    parameters: Annotated[dict[str, ParameterEntry], AfterValidator(_complete)] = Field(
        description="the base model: what a comparison may fit before it looks for missing effects"
    )


class Description(_Description):
    """A gripper of one or two motors."""

    motors: Annotated[tuple[MotorEntry, ...], counted(1, 2, "a list of one motor, or of two (left, right)")] = Field(
        description="one motor, or two: left, right",
        examples=["[{joint: j, actuator: a, closed: 0, open: 0.04}]"],
    )
    fingers: FingersEntry
    force: Literal["sensors", "motor", "none"] | None = Field(None, description="where forces are read")
    control: ControlEntry | None = None
    scale: ScaleEntry | None = None
    training: TrainingEntry | None = Field(None, description="what a training draws; the rest follows from the scene")

    @property
    def training_keys(self) -> dict[str, Any]:
        """What the file says of training."""
        return self.training.model_dump(exclude_none=True) if self.training else {}

    @model_validator(mode="after")
    def _fits_together(self) -> Description:
        names, training = self.parameters, self.training_keys
        gain = {training["servo_gain"]} if "servo_gain" in training else set()
        for key, drawn in (("softness", set(training.get("softness", {}))), ("servo_gain", gain)):
            for name in sorted(drawn - set(names)):
                raise wrong(f"no parameter {name!r}{closest(name, names)}", "training", key)
        has_sensor = bool(self.fingers.left.force_sensor or self.fingers.right.force_sensor)
        if self.force and (self.force == "sensors") != has_sensor:
            raise wrong(f"{self.force}: `sensors` needs a finger with a force_sensor, the others need none", "force")
        return self


class _FirstFingers(_Stroke):
    joints: Names
    actuators: Names
    force_sensors: Names

    @model_validator(mode="after")
    def _must_be_two(self) -> _FirstFingers:
        for key in ("joints", "actuators", "force_sensors"):
            left, right = getattr(self, key)
            if left == right:
                raise wrong("must be two names, [left, right]", key)
        return self


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
        return Description(**kept, motors=motors, fingers=FingersEntry(**fingers), scale=ScaleEntry(position=1.0))
