"""A fitted model as a text file that a person can read and edit."""

# pyright: standard

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import yaml

from forcegrasp.effects import Effect
from forcegrasp.effects.for_gripper import effect_of
from forcegrasp.effects.setting import EffectSetting
from forcegrasp.errors import ConfigError, closest
from forcegrasp.files import plain_yaml
from forcegrasp.files.whole_file import write_whole
from forcegrasp.physics.gripper import Gripper
from forcegrasp.physics.gripper_file import load_gripper
from forcegrasp.short_repr import ShortRepr, counted, cut, some

FORMAT = "forcegrasp-model/1"
#: Name of the model that comes with the package.
SHIPPED = "virtual_robot"
#: Entries of its noise.
NOISE = ("position_std", "force_std_n")
# Of a key in a message.
_LONGEST_KEY = 80


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
        sizes = [f"{name} {fitted.value:.4g} {fitted.unit}" for name, fitted in self.parameters.items()]
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
    grasps: dict[str, dict[str, Fitted]] = field(default_factory=dict)  #: per grasp
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
        "gripper": model.gripper.name_or_path,
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
            **{name: _dump(value) for name, value in e.parameters.items()},
        }
        for e in model.effects
    }
    if model.warnings:
        content["warnings"] = list(model.warnings)
    head = (
        "# A model of a gripper, fitted to measurements. Values may be edited; low and high bound the 95 % interval.\n"
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
        raise _refuse(path, "", f"could not read the model: {why}") from error
    keys = ("format", "gripper", "mujoco", "data", "base", "objects", "grasps", "effects", "warnings", "noise")
    if not isinstance(raw, dict) or raw.get("format") != FORMAT:
        raise _refuse(path, "format", f"must be {FORMAT}; write a model with `forcegrasp fit`")
    for key in raw:
        if key not in keys:
            raise _refuse(path, str(key), f"unknown{closest(str(key), keys)}")
    if not isinstance(raw.get("gripper"), str):
        raise _refuse(path, "gripper", "must be a gripper's name, or the path of its description")
    gripper = _renamed(path, "gripper", lambda: load_gripper(raw["gripper"], path.parent))
    base = _read_all(path, "base", raw.get("base"), gripper, "gripper")
    missing = {n for n, p in gripper.parameters.items() if p.scope == "gripper"} - set(base)
    if missing:
        raise _refuse(path, f"base.{min(missing)}", "missing")
    objects = {
        str(o): _read_all(path, f"objects.{o}", v, gripper, "object") for o, v in _map(path, "objects", raw).items()
    }
    grasps = {str(g): _read_all(path, f"grasps.{g}", v, gripper, "grasp") for g, v in _map(path, "grasps", raw).items()}
    effects = tuple(_read_effect(path, name, entry, gripper) for name, entry in _map(path, "effects", raw).items())
    data = {str(key): _text(path, f"data.{key}", value) for key, value in _map(path, "data", raw).items()}
    lines = [] if raw.get("warnings") is None else raw["warnings"]
    if not isinstance(lines, list):
        raise _refuse(path, "warnings", "must be a list")
    warnings = tuple(_text(path, f"warnings.{index}", line) for index, line in enumerate(lines))
    return Model(gripper, base, objects, grasps, effects, data, warnings, _read_noise(path, raw))


def _read_noise(path: Path, raw: Mapping[str, Any]) -> tuple[float, float] | None:
    entries = _map(path, "noise", raw)
    for key in entries:
        if key not in NOISE:
            raise _refuse(path, f"noise.{key}", f"unknown{closest(str(key), NOISE)}")
    if not entries:
        return None
    for key in NOISE:
        if key not in entries:
            raise _refuse(path, f"noise.{key}", "missing")
        if not 0 < _number(path, f"noise.{key}", entries[key]) < math.inf:
            raise _refuse(path, f"noise.{key}", "must be positive; leave noise out if it is not known")
    return float(entries["position_std"]), float(entries["force_std_n"])


def _read_effect(path: Path, name: Any, entry: Any, gripper: Gripper) -> FoundEffect:
    where = f"effects.{name}"
    effect = _renamed(path, "effects", lambda: effect_of(str(name), gripper))
    if not isinstance(entry, dict):
        raise _refuse(path, where, "must be a mapping of its parameters")
    known = {p.name: p for p in effect.parameters}
    variant = entry.get("variant", effect.variants[0])
    if variant not in effect.variants:
        raise _refuse(path, f"{where}.variant", f"must be {' or '.join(filter(None, effect.variants)) or 'left out'}")
    for key in entry:
        if key != "variant" and key not in known:
            raise _refuse(path, f"{where}.{key}", f"unknown{closest(str(key), known)}")
    parameters = {}
    for p in effect.parameters:
        if p.name not in entry:
            raise _refuse(path, f"{where}.{p.name}", "missing")
        fitted = _read_number(path, f"{where}.{p.name}", entry[p.name], p.unit)
        absent = fitted.low == fitted.value == fitted.high == p.null  # which may be infinite
        if not (absent or (p.low <= fitted.low and fitted.high <= p.high)):
            raise _refuse(path, f"{where}.{p.name}", f"must lie in [{p.low:g}, {p.high:g}] {p.unit}")
        parameters[p.name] = fitted
    return FoundEffect(effect, variant, parameters)


def _read_all(path: Path, where: str, raw: Any, gripper: Gripper, scope: str) -> dict[str, Fitted]:
    if not isinstance(raw, dict):
        raise _refuse(path, where, "must be a mapping of parameters")
    known = {name: p for name, p in gripper.parameters.items() if p.scope == scope}
    for name in raw:
        if name not in known:
            raise _refuse(path, f"{where}.{name}", f"unknown{closest(str(name), known)}")
    found = {}
    for name, entry in raw.items():
        p, fitted = known[name], _read_number(path, f"{where}.{name}", entry, known[name].unit)
        if not (p.low <= fitted.low and fitted.high <= p.high):
            raise _refuse(path, f"{where}.{name}", f"must lie in [{p.low:g}, {p.high:g}] {p.unit}")
        found[name] = fitted
    return found


def _read_number(path: Path, where: str, entry: Any, unit: str) -> Fitted:
    parts = entry if isinstance(entry, dict) else {"value": entry}
    keys = ("value", "low", "high", "unit")
    for key in parts:
        if key not in keys:
            raise _refuse(path, f"{where}.{key}", f"unknown{closest(str(key), keys)}")
    value, low, high = (
        _number(path, f"{where}.{key}" if isinstance(entry, dict) else where, parts.get(key, parts.get("value")))
        for key in ("value", "low", "high")
    )
    if not low <= value <= high:
        raise _refuse(path, where, f"low ≤ value ≤ high must hold, and does not with {low:g}, {value:g}, {high:g}")
    if parts.get("unit", unit) != unit:
        raise _refuse(path, f"{where}.unit", f"must be {unit}")
    return Fitted(value, low, high, unit)


def _number(path: Path, where: str, value: Any) -> float:
    try:
        if isinstance(value, (int, float)) and not isinstance(value, bool) and not math.isnan(value):
            return float(value)
    except OverflowError:
        pass
    hint = "; YAML wants 1.0e-3 for 1e-3" if isinstance(value, str) and "e" in value.lower() else ""
    raise _refuse(path, where, f"must be a number{hint}")


def _text(path: Path, where: str, value: Any) -> str:
    if isinstance(value, str):
        return value
    raise _refuse(path, where, "must be text; put it in quotes")


def _map(path: Path, key: str, raw: Mapping[str, Any]) -> dict:
    value = {} if raw.get(key) is None else raw[key]
    if not isinstance(value, dict):
        raise _refuse(path, key, "must be a mapping")
    return value


def _renamed(path: Path, where: str, call: Callable[[], Any]) -> Any:
    try:
        return call()
    except ConfigError as error:
        raise _refuse(path, where, str(error)) from error


def _refuse(path: Path, where: str, problem: str) -> ConfigError:
    """The error to raise about a key, in one line whatever the file says."""
    key = where if len(where) <= _LONGEST_KEY else f"{where[:_LONGEST_KEY]}…"
    text = ": ".join(filter(None, (str(path), key, problem)))
    return ConfigError(" ".join("".join(c if c.isprintable() else " " for c in text).split()))


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
