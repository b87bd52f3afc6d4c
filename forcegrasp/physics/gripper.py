"""The description of a gripper: its MJCF, the names of what matters in it, and what a fit may change."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import yaml

from forcegrasp.errors import ConfigError, closest

FORMAT = "forcegrasp-gripper/1"
_WRITE = re.compile(r"(-?)((?:actuator|dof|geom)_\w+)(?: (\d+))?")
_SCOPES = ("gripper", "object", "grasp")
#: Parameters that the simulator itself understands; they need no `writes`.
SPECIAL = ("force_scale", "radius_m", "offset_m")


@dataclass(frozen=True)
class FieldWrite:
    """One column of a per-simulation MuJoCo field that follows a parameter."""

    field: str
    column: int | None
    sign: float


@dataclass(frozen=True)
class BaseParameter:
    """What a fit may change about the gripper or an object; never called a missing effect."""

    name: str
    nominal: float
    low: float
    high: float
    unit: str
    scope: str  #: one value for the "gripper", per "object" or per "grasp"
    writes: tuple[FieldWrite, ...]

    @property
    def logarithmic(self) -> bool:
        """Whether it is fitted by its logarithm: it is positive and spans more than a factor of 5."""
        return self.low > 0 and self.high / self.low > 5


@dataclass(frozen=True)
class Gripper:
    """A two-finger gripper and the object between its fingers, as a MuJoCo scene."""

    name: str
    path: Path  #: of the description
    model: Path  #: of the MJCF
    fast: str  #: "sphere" or "none"
    joints: tuple[str, str]  #: left, right
    actuators: tuple[str, str]
    force_sensors: tuple[str, str]
    closed: float  #: joint value where a finger's position is 0
    open: float
    object_joint: str
    object_geom: str
    axis: int  #: 0, 1, 2 for x, y, z
    parameters: dict[str, BaseParameter]

    @property
    def open_m(self) -> float:
        """Position of a fully open finger, metres; fully closed is 0."""
        return abs(self.open - self.closed)

    def compile(self, tier: str = "reference") -> mujoco.MjModel:
        """Returns the scene's model.

        Args:
          tier: ``"reference"`` is the scene as described. ``"fast"``, where the description has ``fast: sphere``, lets
            the pads touch a sphere in the object's place, which spares the collision of cylinder and box that takes
            half of the engine's time, and doubles the physics step.

        Raises:
          ConfigError: if there is no such tier, or MuJoCo refuses the scene.
        """
        if tier not in ("reference", "fast"):
            raise ConfigError(f"physics.tier={tier}: must be reference or fast")
        try:
            spec = mujoco.MjSpec.from_file(str(self.model))
            if tier == "fast" and self.fast == "sphere":
                _simplify(spec, self.object_geom)
            return spec.compile()
        except ValueError as error:
            raise ConfigError(f"{self.model}: MuJoCo refuses it: {_one_line(error)}") from error


# Collision bits of the fast tier: 1 is the pads' contact, 2 that of the ground.
_PADS, _GROUND = 1, 2


def _simplify(spec: mujoco.MjSpec, geom: str) -> None:
    spec.option.timestep *= 2
    real = spec.geom(geom)
    for ground in (real, *spec.worldbody.geoms):
        ground.contype, ground.conaffinity = _GROUND, _GROUND
    sphere = real.parent.add_geom(
        name=f"{geom}_pads",
        type=mujoco.mjtGeom.mjGEOM_SPHERE,
        size=[real.size[0], 0, 0],
        mass=0,
        contype=_PADS,
        conaffinity=_PADS,
        rgba=[0, 0, 0, 0],
    )
    for name in ("condim", "priority", "friction", "solref", "solimp"):
        setattr(sphere, name, getattr(real, name))


def load_gripper(name: str, folder: Path | None = None) -> Gripper:
    """Returns a gripper by name (``tiago``) or by the path of its description.

    Args:
      name: what ``gripper:`` says in a measurement set.
      folder: where a relative path starts; the working directory by default.

    Raises:
      ConfigError: if there is no such gripper, or its description can't be right; names the file and the line's key.
    """
    shipped = Path(str(files("forcegrasp") / "assets"))
    if re.fullmatch(r"\w+", name):
        path = shipped / f"{name}.yaml"
        if not path.is_file():
            known = [p.stem for p in shipped.glob("*.yaml")]
            raise ConfigError(f"gripper={name}: no such gripper{closest(name, known)}; or give a description's path")
    else:
        path = (folder or Path()) / name
    return _load(path)


_loaded: dict[tuple[str, int], Gripper] = {}


def _load(path: Path) -> Gripper:
    try:
        key = (str(path.resolve()), path.stat().st_mtime_ns)
        if key not in _loaded:
            _loaded[key] = _parse(path, yaml.safe_load(path.read_text(encoding="utf-8")))
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise ConfigError(f"{path}: could not read the gripper description: {_one_line(error)}") from error
    return _loaded[key]


def _parse(path: Path, raw: Any) -> Gripper:
    keys = {"format", "name", "model", "fast", "fingers", "object", "parameters"}
    _demand(path, "", raw, keys, optional={"fast"})
    if raw["format"] != FORMAT:
        raise ConfigError(f"{path}: format: must be {FORMAT}")
    fingers, thing = raw["fingers"], raw["object"]
    _demand(path, "fingers.", fingers, {"joints", "actuators", "force_sensors", "closed", "open"})
    _demand(path, "object.", thing, {"joint", "geom", "axis"})
    for key in ("joints", "actuators", "force_sensors"):
        if not isinstance(fingers[key], list) or len(fingers[key]) != 2:
            raise ConfigError(f"{path}: fingers.{key}: must be two names, [left, right]")
    if thing["axis"] not in ("x", "y", "z"):
        raise ConfigError(f"{path}: object.axis: must be x, y or z")
    if raw.get("fast", "none") not in ("none", "sphere"):
        raise ConfigError(f"{path}: fast: must be none or sphere")
    parameters = {name: _parameter(path, name, entry) for name, entry in _mapping(path, raw, "parameters").items()}
    for name in SPECIAL:
        if name not in parameters:
            raise ConfigError(f"{path}: parameters.{name}: missing; every gripper needs {', '.join(SPECIAL)}")
    gripper = Gripper(
        name=str(raw["name"]),
        path=path,
        model=path.parent / str(raw["model"]),
        fast=raw.get("fast", "none"),
        joints=tuple(map(str, fingers["joints"])),
        actuators=tuple(map(str, fingers["actuators"])),
        force_sensors=tuple(map(str, fingers["force_sensors"])),
        closed=_number(path, "fingers.closed", fingers["closed"]),
        open=_number(path, "fingers.open", fingers["open"]),
        object_joint=str(thing["joint"]),
        object_geom=str(thing["geom"]),
        axis="xyz".index(thing["axis"]),
        parameters=parameters,
    )
    if gripper.open_m == 0:
        raise ConfigError(f"{path}: fingers.open: must differ from fingers.closed")
    _check_against_model(gripper)
    return gripper


def _parameter(path: Path, name: str, entry: Any) -> BaseParameter:
    where = f"parameters.{name}."
    _demand(path, where, entry, {"nominal", "low", "high", "unit", "scope", "writes"})
    nominal, low, high = (_number(path, where + key, entry[key]) for key in ("nominal", "low", "high"))
    if not low < nominal < high:
        raise ConfigError(f"{path}: {where}nominal={nominal:g}: must lie between low={low:g} and high={high:g}")
    if entry["scope"] not in _SCOPES:
        raise ConfigError(f"{path}: {where}scope={entry['scope']}: must be one of {', '.join(_SCOPES)}")
    writes = []
    for text in entry["writes"] or []:
        match = _WRITE.fullmatch(str(text))
        if not match:
            raise ConfigError(f"{path}: {where}writes: {text!r} must look like `actuator_gainprm 0` or `-dof_damping`")
        sign, field, column = match.groups()
        writes.append(FieldWrite(field, None if column is None else int(column), -1.0 if sign else 1.0))
    if not writes and name not in SPECIAL:
        raise ConfigError(f"{path}: {where}writes: must name a field of the model, such as `dof_damping`")
    return BaseParameter(name, nominal, low, high, str(entry["unit"]), entry["scope"], tuple(writes))


def _check_against_model(gripper: Gripper) -> None:
    """Finds names and fields that the scene does not have while the description is at hand to be blamed."""
    path, model = gripper.path, gripper.compile()
    kinds = {
        "fingers.joints": (model.joint, gripper.joints),
        "fingers.actuators": (model.actuator, gripper.actuators),
        "fingers.force_sensors": (model.sensor, gripper.force_sensors),
        "object.joint": (model.joint, (gripper.object_joint,)),
        "object.geom": (model.geom, (gripper.object_geom,)),
    }
    for key, (find, names) in kinds.items():
        for name in names:
            try:
                find(name)
            except KeyError as error:
                raise ConfigError(f"{path}: {key}: {gripper.model.name} has no {name!r}") from error
    slide = mujoco.mjtJoint.mjJNT_SLIDE
    if any(model.joint(name).type[0] != slide for name in gripper.joints):
        raise ConfigError(f"{path}: fingers.joints: must be slide joints")
    for parameter in gripper.parameters.values():
        for write in parameter.writes:
            where = f"{path}: parameters.{parameter.name}.writes: {write.field}"
            field = getattr(model, write.field, None)
            if not isinstance(field, np.ndarray):
                raise ConfigError(f"{where} is no field of MuJoCo's model")
            columns = field.shape[1] if field.ndim == 2 else None
            if (columns is None) != (write.column is None) or (columns is not None and write.column >= columns):
                need = "no column" if columns is None else f"a column from 0 to {columns - 1}"
                raise ConfigError(f"{where} needs {need}")


def _mapping(path: Path, raw: dict, key: str) -> dict:
    if not isinstance(raw[key], dict):
        raise ConfigError(f"{path}: {key}: must be a mapping")
    return raw[key]


def _demand(path: Path, where: str, raw: Any, keys: set[str], optional: set[str] = frozenset()) -> None:
    if not isinstance(raw, dict):
        raise ConfigError(f"{path}: {where.rstrip('.') or 'the file'}: must map {', '.join(sorted(keys))}")
    for key in raw:
        if key not in keys:
            raise ConfigError(f"{path}: {where}{key}: unknown{closest(str(key), keys)}")
    for key in sorted(keys - optional):
        if key not in raw:
            raise ConfigError(f"{path}: {where}{key}: missing")


def _number(path: Path, where: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise ConfigError(f"{path}: {where}={value}: must be a number")
    return float(value)


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())
