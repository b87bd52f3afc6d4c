"""A fitted model as a text file that a person can read and edit."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any, TypeVar

import mujoco
import numpy as np
import yaml
from pydantic import ConfigDict, Field, model_validator

from forcegrasp.effects import Effect
from forcegrasp.effects.base import Parameter
from forcegrasp.effects.for_gripper import effect_of
from forcegrasp.effects.law import Formula, Law, formula_as_data, make_law
from forcegrasp.effects.setting import EffectSetting
from forcegrasp.errors import ConfigError, closest
from forcegrasp.files import plain_yaml
from forcegrasp.files.neighbour import seen_from
from forcegrasp.files.validate import Record, must, refusal, validate, wrong
from forcegrasp.files.whole_file import write_whole
from forcegrasp.models.object_body import ObjectBody
from forcegrasp.physics.gripper import Gripper
from forcegrasp.physics.gripper_file import load_gripper
from forcegrasp.physics.gripper_parts import SCOPES, BaseParameter
from forcegrasp.short_repr import ShortRepr, counted, cut, some

FORMAT = "forcegrasp-model/1"
#: Name of the model that comes with the package.
SHIPPED = "virtual_robot"
#: Entries of its noise.
NOISE = ("position_std", "force_std_n")
AnyResult = TypeVar("AnyResult")


@dataclass(frozen=True)
class Fitted:
    """A number with its 95 % interval."""

    value: float
    low: float
    high: float
    unit: str = ""


@dataclass(frozen=True, repr=False)
class FoundEffect(ShortRepr):
    """An effect of a model, with its parameters."""

    effect: type[Effect]
    variant: str
    parameters: dict[str, Fitted]

    def summary(self) -> str:
        sizes = [f"{name} {v.value:.4g} {v.unit}".removesuffix(" 1") for name, v in self.parameters.items()]
        return f"{self.effect.name} {self.variant}".strip() + f": {some(sizes)}"

    @property
    def values(self) -> np.ndarray:
        """The parameters in the order of the class, ``(parameters,)``."""
        return np.array([self.parameters[p.name].value for p in self.effect.parameters])

    @property
    def setting(self) -> EffectSetting:
        """The effect as it was found, without its intervals."""
        return EffectSetting(self.effect, self.variant, self.values)


@dataclass(frozen=True, repr=False)
class Model(ShortRepr):
    """A gripper's fitted base parameters, and the effects that were found."""

    gripper: Gripper
    base: dict[str, Fitted]  #: of the gripper as a whole
    objects: dict[str, dict[str, Fitted]] = field(default_factory=dict)  #: per object
    grasps: dict[str, dict[str, Fitted]] = field(default_factory=dict)  #: per grasp, or per recording
    effects: tuple[FoundEffect, ...] = ()
    data: dict[str, str] = field(default_factory=dict)  #: set and fingerprint
    warnings: tuple[str, ...] = ()
    #: Standard deviations of the readings: positions, m or rad; forces, newtons. None if it does not say.
    noise: tuple[float, float] | None = None

    def summary(self) -> str:
        effects = some(e.effect.name for e in self.effects) or "none"
        return f"{cut(self.gripper.name)}, effects: {effects}; {counted(len(self.warnings), 'warning')}"


def write_model(model: Model, path: str | Path) -> None:
    """Writes a model as YAML, whole or not at all.

    Raises:
      ConfigError: if the file can't be written.
    """
    path = Path(path)
    content: dict[str, Any] = {
        "format": FORMAT,
        "gripper": seen_from(path.parent, model.gripper.name_or_path, path.parent),
        "mujoco": mujoco.__version__,
        "data": dict(model.data),
        "base": {name: _dump(v) for name, v in model.base.items()},
        "objects": {o: {name: _dump(v) for name, v in vs.items()} for o, vs in model.objects.items()},
    }
    if model.noise is not None:
        content["noise"] = _Numbers(zip(NOISE, map(float, model.noise), strict=True))
    if model.grasps:
        content["grasps"] = {g: {name: _dump(v) for name, v in vs.items()} for g, vs in model.grasps.items()}
    content["effects"] = {
        e.effect.name: {
            **({"variant": e.variant} if e.variant else {}),
            **({"law": formula_as_data(e.effect)} if issubclass(e.effect, Law) else {}),
            **{name: _dump(value) for name, value in e.parameters.items()},
        }
        for e in model.effects
    }
    if model.warnings:
        content["warnings"] = list(model.warnings)
    head = (
        "# A model of a gripper. Values may be edited; low and high bound the 95 % interval.\n"
        "# Training draws from the interval: forcegrasp train model=THIS_FILE\n"
    )
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        text = head + yaml.dump(content, sort_keys=False, allow_unicode=True, width=120, Dumper=_Flat)
        write_whole(path, text.encode())
    except OSError as error:
        raise ConfigError(f"{path}: could not write the model ({error.strerror})") from error


def read_model(path: str | Path) -> Model:
    """Reads a model; ``virtual_robot`` is the one that comes with the package.

    Raises:
      ConfigError: names the file, the key, and what it must be.
    """
    path = Path(str(files("forcegrasp.assets") / f"{SHIPPED}.yaml")) if str(path) == SHIPPED else Path(path)
    try:
        raw = plain_yaml.load(path)
    except (OSError, plain_yaml.PlainYamlError) as error:
        why = getattr(error, "strerror", None) or str(error)
        raise refusal(path, "", f"could not read the model: {why}") from error
    if not isinstance(raw, dict) or raw.get("format") != FORMAT:
        raise refusal(path, "format", f"must be {FORMAT}; write a model with `forcegrasp fit`")
    said = validate(_File, raw, path)
    gripper = _renamed(path, "gripper", lambda: load_gripper(said.gripper, path.parent))
    scopes = {scope: {n: p for n, p in gripper.parameters.items() if p.scope == scope} for scope in SCOPES}
    return Model(
        gripper,
        base=_fitted(path, "base", said.base, scopes["gripper"], required=True),
        objects={o: _fitted(path, f"objects.{o}", v, scopes["object"]) for o, v in (said.objects or {}).items()},
        grasps={
            g: _fitted(path, f"grasps.{g}", v, scopes["grasp"] | scopes["recording"])
            for g, v in (said.grasps or {}).items()
        },
        effects=tuple(_found(path, name, entry, gripper) for name, entry in (said.effects or {}).items()),
        data=said.data or {},
        warnings=tuple(said.warnings or ()),
        noise=(said.noise.position_std, said.noise.force_std_n) if said.noise else None,
    )


_Number = Annotated[float, Field(allow_inf_nan=True), must(lambda v: not math.isnan(v), "must be a number, not nan")]
_Noise = Annotated[
    float,
    Field(allow_inf_nan=True),
    must(lambda std: 0 < std < math.inf, "must be positive; leave noise out if it is not known"),
]


class _Interval(Record):
    """A number and its 95 % interval, or a number alone, which is certain."""

    value: _Number
    low: _Number = -math.inf
    high: _Number = math.inf
    unit: str = ""

    @model_validator(mode="before")
    @classmethod
    def _alone(cls, entry: object) -> object:
        return entry if isinstance(entry, dict) else {"value": entry}

    @model_validator(mode="after")
    def _in_order(self) -> _Interval:
        if not self.low <= self.value <= self.high:
            numbers = f"{self.low:g}, {self.value:g}, {self.high:g}"
            raise wrong(f"low ≤ value ≤ high must hold, and does not with {numbers}")
        return self


class _Effect(Record):
    """Every other key is one of its parameters; ``law`` is what a file said that the effect is, if one did."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, _Interval]  # pyright: ignore[reportIncompatibleVariableOverride]
    variant: str = ""
    law: Formula | None = None


class _ReadingNoise(Record):
    position_std: _Noise = Field(description="m or rad")
    force_std_n: _Noise = Field(description="N")


class _File(Record):
    format: str
    gripper: str = Field(description="name, or the path of its description", examples=["./my_gripper.yaml"])
    mujoco: Any = Field(default=None, description="version; for the reader")
    data: dict[str, str] | None = Field(default=None, description="measurement set and fingerprint")
    base: dict[str, _Interval] = Field(description="base parameters of the gripper as a whole")
    objects: dict[str, dict[str, _Interval]] | None = Field(default=None, description="object: its base parameters")
    grasps: dict[str, dict[str, _Interval]] | None = Field(default=None, description="grasp: its base parameters")
    effects: dict[str, _Effect] | None = Field(default=None, description="effect: its parameters")
    noise: _ReadingNoise | None = Field(default=None, description="standard deviations of the readings")
    warnings: list[str] | None = None


def _found(path: Path, name: str, entry: _Effect, gripper: Gripper) -> FoundEffect:
    where = f"effects.{name}"
    law = entry.law
    effect = _renamed(path, "effects", lambda: _effect(name, law, gripper))
    variant = entry.variant if "variant" in entry.model_fields_set else effect.variants[0]
    if variant not in effect.variants:
        known = " or ".join(filter(None, effect.variants)) or "left out"
        raise refusal(path, f"{where}.variant", f"must be {known}")
    known = {p.name: p for p in effect.parameters}
    before = {p.name: _Interval(value=p.if_missing) for p in effect.parameters if p.if_missing is not None}
    return FoundEffect(effect, variant, _fitted(path, where, before | entry.__pydantic_extra__, known, required=True))


def _effect(name: str, law: Formula | None, gripper: Gripper) -> type[Effect]:
    """An effect of the catalogue, a law, or what a robot's objects are."""
    if name == ObjectBody.name:
        return ObjectBody
    return make_law(name, law, gripper) if law else effect_of(name, gripper)


def _fitted(
    path: Path,
    where: str,
    entries: Mapping[str, _Interval],
    known: Mapping[str, BaseParameter] | Mapping[str, Parameter],
    required: bool = False,
) -> dict[str, Fitted]:
    """Entries as numbers of these parameters, in the order of the file; all of them must be there if ``required``."""
    for name in entries:
        if name not in known:
            raise refusal(path, f"{where}.{name}", f"unknown{closest(name, known)}")
    for name in known:
        if required and name not in entries:
            raise refusal(path, f"{where}.{name}", "missing")
    found = {}
    for name, entry in entries.items():
        p, place = known[name], f"{where}.{name}"
        if "unit" in entry.model_fields_set and entry.unit != p.unit:
            raise refusal(path, f"{place}.unit", f"must be {p.unit}")
        ends = {"low": entry.value, "high": entry.value} | entry.model_dump(exclude_unset=True, exclude={"unit"})
        found[name] = fitted = Fitted(**ends, unit=p.unit)
        absent = isinstance(p, Parameter) and fitted.low == fitted.value == fitted.high == p.null  # may be infinite
        if not (absent or (p.low <= fitted.low and fitted.high <= p.high)):
            raise refusal(path, place, f"must lie in [{p.low:g}, {p.high:g}] {p.unit}")
    return found


def _renamed(path: Path, where: str, call: Callable[[], AnyResult]) -> AnyResult:
    try:
        return call()
    except ConfigError as error:
        raise refusal(path, where, str(error)) from error


class _Numbers(dict):
    """Written on one line."""


class _Flat(yaml.SafeDumper):
    """Writes a number and its interval on one line."""


_Flat.add_representer(_Numbers, lambda dumper, data: dumper.represent_mapping("tag:yaml.org,2002:map", data, True))
_Flat.ignore_aliases = lambda self, data: True


def _dump(number: Fitted) -> _Numbers:
    return _Numbers(
        value=float(f"{number.value:.8g}"),
        low=float(f"{number.low:.8g}"),
        high=float(f"{number.high:.8g}"),
        unit=number.unit,
    )
