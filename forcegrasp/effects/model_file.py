"""A fitted model as a text file that a person can read and edit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import yaml

from forcegrasp.effects import Effect, get_effect
from forcegrasp.errors import ConfigError, closest
from forcegrasp.physics.gripper import Gripper, load_gripper

FORMAT = "forcegrasp-model/1"


@dataclass(frozen=True)
class Fitted:
    """A number with its 95 % interval."""

    value: float
    low: float
    high: float
    unit: str = ""


@dataclass(frozen=True)
class FoundEffect:
    """An effect of a model, with its parameters."""

    effect: type[Effect]
    variant: str
    parameters: dict[str, Fitted]

    @property
    def values(self) -> np.ndarray:
        """The parameters in the order of the class, ``(parameters,)``."""
        return np.array([self.parameters[p.name].value for p in self.effect.parameters])


@dataclass(frozen=True)
class Model:
    """A gripper's fitted base parameters, and the effects that were found."""

    gripper: Gripper
    base: dict[str, Fitted]  #: of the gripper as a whole
    objects: dict[str, dict[str, Fitted]] = field(default_factory=dict)  #: per object
    grasps: dict[str, dict[str, Fitted]] = field(default_factory=dict)  #: per grasp
    effects: tuple[FoundEffect, ...] = ()
    data: dict[str, str] = field(default_factory=dict)  #: set and fingerprint
    warnings: tuple[str, ...] = ()


def write_model(model: Model, path: Path) -> None:
    """Writes a model as YAML.

    Raises:
      ConfigError: if the file can't be written.
    """
    content: dict[str, Any] = {
        "format": FORMAT,
        "gripper": _gripper_name(model.gripper),
        "mujoco": mujoco.__version__,
        "data": dict(model.data),
        "base": {name: _dump(v) for name, v in model.base.items()},
        "objects": {o: {name: _dump(v) for name, v in vs.items()} for o, vs in model.objects.items()},
    }
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
        path.write_text(head + yaml.dump(content, sort_keys=False, allow_unicode=True, width=120, Dumper=_Flat))
    except OSError as error:
        raise ConfigError(f"{path}: could not write the model ({error.strerror})") from error


def read_model(path: Path) -> Model:
    """Reads a model.

    Raises:
      ConfigError: names the file, the key, and what it must be.
    """
    try:
        raw = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, yaml.YAMLError, ValueError) as error:
        raise ConfigError(f"{path}: could not read the model: {' '.join(str(error).split())}") from error
    keys = ("format", "gripper", "mujoco", "data", "base", "objects", "grasps", "effects", "warnings")
    if not isinstance(raw, dict) or raw.get("format") != FORMAT:
        raise ConfigError(f"{path}: format: must be {FORMAT}; write a model with `forcegrasp fit`")
    for key in raw:
        if key not in keys:
            raise ConfigError(f"{path}: {key}: unknown{closest(str(key), keys)}")
    if not isinstance(raw.get("gripper"), str):
        raise ConfigError(f"{path}: gripper: missing")
    gripper = load_gripper(raw["gripper"], path.parent)
    base = _read_all(path, "base", raw.get("base"), gripper, "gripper")
    missing = {n for n, p in gripper.parameters.items() if p.scope == "gripper"} - set(base)
    if missing:
        raise ConfigError(f"{path}: base.{min(missing)}: missing")
    objects = {
        str(o): _read_all(path, f"objects.{o}", v, gripper, "object") for o, v in _map(path, "objects", raw).items()
    }
    grasps = {str(g): _read_all(path, f"grasps.{g}", v, gripper, "grasp") for g, v in _map(path, "grasps", raw).items()}
    effects = tuple(_read_effect(path, name, entry) for name, entry in _map(path, "effects", raw).items())
    data = {str(k): str(v) for k, v in _map(path, "data", raw).items()}
    lines = raw.get("warnings") or []
    if not isinstance(lines, list):
        raise ConfigError(f"{path}: warnings: must be a list")
    return Model(gripper, base, objects, grasps, effects, data, tuple(map(str, lines)))


def _read_effect(path: Path, name: str, entry: Any) -> FoundEffect:
    where = f"effects.{name}"
    effect = _renamed(f"{path}: effects: ", lambda: get_effect(str(name)))
    if not isinstance(entry, dict):
        raise ConfigError(f"{path}: {where}: must be a mapping of its parameters")
    known = {p.name: p for p in effect.parameters}
    variant = entry.get("variant", "")
    if variant and variant not in effect.variants:
        raise ConfigError(f"{path}: {where}.variant: must be one of {', '.join(effect.variants)}")
    for key in entry:
        if key != "variant" and key not in known:
            raise ConfigError(f"{path}: {where}.{key}: unknown{closest(str(key), known)}")
    parameters = {}
    for parameter in effect.parameters:
        if parameter.name not in entry:
            raise ConfigError(f"{path}: {where}.{parameter.name}: missing")
        fitted = _read_number(path, f"{where}.{parameter.name}", entry[parameter.name], parameter.unit)
        if not (parameter.low <= fitted.low <= fitted.high <= parameter.high or fitted.value == parameter.null):
            limits = f"[{parameter.low:g}, {parameter.high:g}] {parameter.unit}"
            raise ConfigError(f"{path}: {where}.{parameter.name}: must lie in {limits}")
        parameters[parameter.name] = fitted
    return FoundEffect(effect, variant or effect.variants[0], parameters)


def _read_all(path: Path, where: str, raw: Any, gripper: Gripper, scope: str) -> dict[str, Fitted]:
    if not isinstance(raw, dict):
        raise ConfigError(f"{path}: {where}: must be a mapping of parameters")
    known = {name: p for name, p in gripper.parameters.items() if p.scope == scope}
    for name in raw:
        if name not in known:
            raise ConfigError(f"{path}: {where}.{name}: unknown{closest(str(name), known)}")
    found = {}
    for name, entry in raw.items():
        found[name] = _read_number(path, f"{where}.{name}", entry, known[name].unit)
        if not known[name].low <= found[name].value <= known[name].high:
            raise ConfigError(f"{path}: {where}.{name}: must lie in [{known[name].low:g}, {known[name].high:g}]")
    return found


def _read_number(path: Path, where: str, entry: Any, unit: str) -> Fitted:
    parts = entry if isinstance(entry, dict) else {"value": entry}
    for key in parts:
        if key not in ("value", "low", "high", "unit"):
            raise ConfigError(f"{path}: {where}.{key}: unknown{closest(str(key), ('value', 'low', 'high', 'unit'))}")
    numbers = []
    for key in ("value", "low", "high"):
        number = parts.get(key, parts.get("value"))
        if isinstance(number, bool) or not isinstance(number, (int, float)) or number != number:
            raise ConfigError(f"{path}: {where}.{key}: must be a number")
        numbers.append(float(number))
    value, low, high = numbers
    if not low <= value <= high:
        raise ConfigError(f"{path}: {where}: low ≤ value ≤ high must hold")
    if parts.get("unit", unit) != unit:
        raise ConfigError(f"{path}: {where}.unit: must be {unit}")
    return Fitted(value, low, high, unit)


def _map(path: Path, key: str, raw: Mapping[str, Any]) -> dict:
    value = raw.get(key) or {}
    if not isinstance(value, dict):
        raise ConfigError(f"{path}: {key}: must be a mapping")
    return value


def _renamed(prefix: str, call):
    try:
        return call()
    except ConfigError as error:
        raise ConfigError(f"{prefix}{error}") from error


def _gripper_name(gripper: Gripper) -> str:
    return gripper.path.stem if gripper.is_shipped else str(gripper.path.resolve())


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
