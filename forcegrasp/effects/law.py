"""Effects that a file describes by a formula: a force on the motors, a shift of what is commanded, or of a reading."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
import yaml
from pydantic import Field, model_validator

from forcegrasp.effects.base import Contribution, Effect, Parameter, State
from forcegrasp.effects.each_finger import SIDES
from forcegrasp.effects.expression import FUNCTIONS, LONGEST, Expression
from forcegrasp.effects.registry import catalogue
from forcegrasp.errors import ConfigError, PhysicsError
from forcegrasp.files import plain_yaml
from forcegrasp.files.validate import Record, must, refusal, text, validate, wrong
from forcegrasp.files.whole_file import write_whole
from forcegrasp.physics.gripper import Gripper

#: How the name of a file ends that describes a law.
SUFFIXES = (".yaml", ".yml")
_COMMON = ("position", "velocity", "force", "time", "time_since_contact", "side")
#: Signals that a law may hold, by the place where it acts.
SIGNALS = {
    "motor": (*_COMMON, "command"),
    "command": (*_COMMON, "command"),
    "position": (*_COMMON, "acceleration"),
    "force": (*_COMMON, "acceleration"),
}
_OF_CONTACT = {"force", "time_since_contact"}
# Keys that an effect of a model file has besides its parameters.
_TAKEN = ("law", "variant")
_HEAD = (
    "# An effect for a model: forcegrasp add effect=THIS_FILE data=SET model=MODEL\n"
    "# The name, the formula and all numbers may be edited. A fit starts from value and stays between low and high.\n"
)


class Size(Record):
    """A parameter of a law: where a fit starts, and between what it stays."""

    value: float = Field(description="where a fit starts")
    low: float
    high: float
    unit: str = ""

    @model_validator(mode="after")
    def _in_order(self) -> Size:
        if not self.low <= self.value <= self.high or self.low == self.high:
            raise wrong(f"low ≤ value ≤ high must hold, and does not with {self.low:g}, {self.value:g}, {self.high:g}")
        return self


class Formula(Record):
    """What a law is, but for its name."""

    place: Literal["motor", "command", "position", "force"] = Field(description="where it acts")
    expression: Annotated[str, text(LONGEST)] = Field(examples=["c1 * abs(velocity) * velocity"])
    parameters: dict[str, Size] = Field(examples=["c1: {value: 0.1, low: -1, high: 1, unit: N}"])
    symptom: Annotated[str, text(300)] = "a formula of a file"

    @model_validator(mode="after")
    def _understood(self) -> Formula:
        for name in self.parameters:
            if not name.isidentifier() or name in {*SIGNALS[self.place], *FUNCTIONS, *_TAKEN}:
                raise wrong("may not be the name of a parameter; c1 may", "parameters", name)
        try:
            parsed = self.parsed()
        except ValueError as error:
            raise wrong(str(error), "expression") from error
        for name, size in self.parameters.items():
            if name in parsed.coefficients and (size.value == 0 or not size.low <= 0 <= size.high):
                raise wrong("is a coefficient: value must not be 0, and 0 must lie in [low, high]", "parameters", name)
            if name in parsed.lags and size.low <= 0:
                raise wrong("is a time constant: low must be positive", "parameters", name)
        return self

    def parsed(self) -> Expression:
        """The expression.

        Raises:
          ValueError: if it can't be understood.
        """
        return Expression(self.expression, SIGNALS[self.place], self.parameters)


class _File(Formula):
    name: Annotated[
        str, text(40), must(lambda name: name.isidentifier() and name.isascii(), "must be letters, digits and _")
    ] = Field(examples=["quadratic_drag"])


class Law(Effect):
    """An effect that is a formula of signals; subclasses say where it acts."""

    family = "law"
    source = "a file"
    order = -1  # before what else is done to a reading: where its force is 0, nothing touches
    formula_of: ClassVar[Formula]
    parsed: ClassVar[Expression]

    def init(self, which: np.ndarray) -> State:
        rows, width = len(which), self._width()
        never = np.full((rows, self.motors), np.nan)
        state: State = {"time": np.full((rows, 1), -self.dt)}
        state |= {name: np.zeros((rows, width)) for name in ("since", "command")}
        return state | self._seen(rows, never) | self.parsed.memory(rows, width)

    def _width(self) -> int:
        return self.channels if self.formula_of.place == "force" else self.motors

    def _seen(self, rows: int, never: np.ndarray) -> State:
        return {}

    def _value(self, force: np.ndarray, **signals: np.ndarray) -> np.ndarray:
        """What the formula comes to in this step, ``(rows, width)``; time goes on by one step."""
        state, width = self.state, self._width()
        force = _of_width(force, width)
        state["time"] = time = state["time"] + self.dt
        began = state["since"] > 0
        since = np.where(began, state["since"], 0.0)
        state["since"] = np.where(began | (force != 0), since + self.dt, 0.0)
        signals = {name: _of_width(values, width) for name, values in signals.items()}
        signals |= {"force": force, "time": time, "time_since_contact": since, "side": SIDES}
        value = self.parsed.value(signals, {p.name: self[p.name] for p in self.parameters}, state, self.dt)
        if not np.isfinite(value).all():
            raise PhysicsError(
                f"{self.name}: `{self.formula_of.expression}` is no finite number; narrow its parameters"
            )
        return value


class _MotorLaw(Law):
    stage = "actuator"

    def command(self, command: np.ndarray, fresh: np.ndarray) -> np.ndarray:
        self.state["command"] = command
        return command

    def act(self) -> Contribution:
        signals = {"position": self.position, "velocity": self.velocity, "command": self.state["command"]}
        return Contribution(motor_push=self._value(self.pad_force, **signals))


class _CommandLaw(Law):
    stage = "command"

    def command(self, command: np.ndarray, fresh: np.ndarray) -> np.ndarray:
        return command + self._value(self.pad_force, position=self.position, velocity=self.velocity, command=command)


class _ReadingLaw(Law):
    """Of one instant the position is read first: the law of a position sees the force of the step before."""

    stage = "sensor"

    def _seen(self, rows: int, never: np.ndarray) -> State:
        state = {name: np.zeros_like(never) for name in ("speed", "acceleration")}
        return {"last": never, **state, "force": np.zeros((rows, self.channels))}

    def read_force(self, force: np.ndarray) -> np.ndarray:
        state = self.state
        state["force"] = force
        if self.formula_of.place != "force":
            return force
        return force + self._value(
            force, position=state["last"], velocity=state["speed"], acceleration=state["acceleration"]
        )

    def read_position(self, position: np.ndarray) -> np.ndarray:
        state, dt = self.state, self.dt
        known = ~np.isnan(state["last"])
        speed = np.where(known, (position - state["last"]) / dt, 0.0)
        state["acceleration"] = np.where(known, (speed - state["speed"]) / dt, 0.0)
        state["last"], state["speed"] = position, speed
        if self.formula_of.place != "position":
            return position
        return position + self._value(
            state["force"], position=position, velocity=speed, acceleration=state["acceleration"]
        )


_KINDS: dict[str, type[Law]] = {
    "motor": _MotorLaw,
    "command": _CommandLaw,
    "position": _ReadingLaw,
    "force": _ReadingLaw,
}


def make_law(name: str, formula: Formula, gripper: Gripper) -> type[Law]:
    """The effect that a formula is, on a gripper.

    Raises:
      ConfigError: if the name is taken, or the gripper lacks what the formula holds.
    """
    if name in catalogue() or name == "none":
        raise ConfigError(f"name: {name} is an effect of the catalogue; choose another")
    parsed, channels = formula.parsed(), len(gripper.forces)
    reads = formula.place in ("position", "force")
    if formula.place == "force" and not channels:
        raise ConfigError(f"place: {gripper.name} has no force readings")
    if parsed.uses & _OF_CONTACT and not (channels if reads else not gripper.is_servo):
        raise ConfigError(f"expression: {' and '.join(sorted(parsed.uses & _OF_CONTACT))}: {gripper.name} has none")
    if "side" in parsed.uses and not has_sides(formula.place, gripper):
        raise ConfigError(f"expression: side tells left from right, and {gripper.name} has not both at {formula.place}")
    kind = _KINDS[formula.place]
    return type(kind.__name__, (kind,), {
        "__doc__": formula.symptom, "name": name, "symptom": formula.symptom, "formula_of": formula, "parsed": parsed,
        "formula": f"{_SUM[formula.place]} + {formula.expression}", "motors": len(gripper.motors), "channels": channels,
        "parameters": tuple(_parameter(n, size, parsed) for n, size in formula.parameters.items()),
        "commands_effort": gripper.command != "position", "trials": classmethod(_trials),
    })  # fmt: skip


def has_sides(place: str, gripper: Gripper) -> bool:
    """Whether what a law changes there is that of a left and a right finger, which `side` tells apart: 1 and −1."""
    width = len(gripper.forces) if place == "force" else len(gripper.motors)
    return not gripper.is_servo and width == len(SIDES)


_SUM = {"motor": "F' = F", "command": "u' = u", "position": "q' = q", "force": "f' = f"}


def _parameter(name: str, size: Size, parsed: Expression) -> Parameter:
    is_coefficient = name in parsed.coefficients
    doc, null = ("coefficient", 0.0) if is_coefficient else ("number of its formula", size.value)
    logarithmic = not is_coefficient and size.low > 0
    return Parameter(
        name, doc, size.unit, size.low, size.high, size.value or size.high, null=null, logarithmic=logarithmic
    )


def _trials(law: type[Law]) -> np.ndarray:
    """The sizes of the file; of a law of coefficients alone each of them by itself."""
    sizes = np.array([size.value for size in law.formula_of.parameters.values()])
    return np.diag(sizes) if len(law.parsed.coefficients) == len(sizes) else sizes[None]


def _of_width(values: np.ndarray, width: int) -> np.ndarray:
    """A column for each motor or reading: where they don't pair off, the mean for all."""
    if values.shape[1] == width:
        return values
    return values.mean(axis=1, keepdims=True) if values.shape[1] else np.zeros((len(values), 1))


def read_law(path: str | Path, gripper: Gripper) -> type[Law]:
    """Reads an effect that a file describes, for a gripper.

    Raises:
      ConfigError: names the file, the key, and what it must be.
    """
    path = Path(path)
    try:
        raw = plain_yaml.load(path)
    except (OSError, plain_yaml.PlainYamlError) as error:
        raise refusal(path, "", f"could not read the law: {getattr(error, 'strerror', None) or error}") from error
    said = validate(_File, raw, path)
    formula = Formula(**{name: getattr(said, name) for name in Formula.model_fields})
    try:
        return make_law(said.name, formula, gripper)
    except ConfigError as error:
        raise refusal(path, "", str(error)) from error


def write_law(law: type[Law], path: Path) -> None:
    """Writes an effect that :func:`read_law` reads.

    Raises:
      ConfigError: if the file can't be written.
    """
    content = {"name": law.name, **formula_as_data(law)}
    dumped = yaml.safe_dump(content, sort_keys=False, allow_unicode=True, width=120, default_flow_style=None)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, (_HEAD + dumped).encode())
    except OSError as error:
        raise ConfigError(f"{path}: could not write the law ({error.strerror})") from error


def formula_as_data(law: type[Law]) -> dict[str, Any]:
    """A law's formula in plain types, as files hold it."""
    return law.formula_of.model_dump()
