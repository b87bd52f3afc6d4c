"""The description of a gripper: its MJCF, the names of what matters in it, and what a fit may change."""

# pyright: standard

from __future__ import annotations

import math
import re
from collections.abc import Set
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from mujoco.batch import MODEL_FIELDS

from forcegrasp import plain_yaml
from forcegrasp.errors import ConfigError, closest
from forcegrasp.physics.fast import compile_fast
from forcegrasp.physics.guard import silence_log
from forcegrasp.physics.scene_file import check_scene
from forcegrasp.short_repr import ShortRepr, counted, cut

FORMAT = "forcegrasp-gripper/1"
_WRITE = re.compile(r"(-?)((?:actuator|dof|geom)_\w+)(?: (\d+))?")
#: Physics steps that divide a control step of 40 ms well, and take less than forever.
_TIMESTEP_S = (5e-5, 0.02)
_LONGEST_TEXT = 200
_NETFORCE = 3  #: index of reduce="netforce" among a contact sensor's ways to reduce
_SCOPES = ("gripper", "object", "grasp")
#: Physics tiers, and how much larger than the scene's own their steps may be.
TIERS = {"reference": 1, "fitting": 2, "fast": 4}
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
        """Whether it is fitted by its logarithm, as it is positive and spans more than a factor of 5."""
        return self.low > 0 and self.high / self.low > 5


@dataclass(frozen=True, repr=False)
class Gripper(ShortRepr):
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

    def summary(self) -> str:
        return f"{cut(self.name)}, {counted(len(self.parameters), 'parameter')}"

    @property
    def open_m(self) -> float:
        """Position of a fully open finger, metres; fully closed is 0."""
        return abs(self.open - self.closed)

    @property
    def is_shipped(self) -> bool:
        """Whether it comes with the package, and so is known by its name."""
        return self.path.parent == shipped_folder()

    def compile(self, tier: str = "reference") -> mujoco.MjModel:
        """Returns the scene's model.

        Args:
          tier: ``"reference"`` is the scene as described; ``"fast"``, where the description has ``fast: sphere``, is
            ``forcegrasp.physics.fast``; ``"fitting"`` is that with at most twice the step, whose slopes are exact
            enough for a fit.

        Raises:
          ConfigError: if there is no such tier, or MuJoCo refuses the scene.
        """
        if tier not in TIERS:
            raise ConfigError(f"physics.tier={tier}: must be reference or fast")
        silence_log()
        check_scene(self.model)
        try:
            spec = mujoco.MjSpec.from_file(str(self.model))
            if TIERS[tier] == 1 or self.fast == "none":
                return spec.compile()
            return compile_fast(spec, self, TIERS[tier])
        except (ValueError, RuntimeError) as error:
            raise ConfigError(f"{self.model}: MuJoCo refuses it: {_one_line(error)}") from error


def shipped_folder() -> Path:
    """Where the descriptions that come with the package are."""
    return Path(str(files("forcegrasp") / "assets"))


def load_gripper(name: str | Path, folder: str | Path = "") -> Gripper:
    """Returns a gripper by name (``tiago``) or by the path of its description.

    Args:
      name: what ``gripper:`` says in a measurement set.
      folder: where a relative path starts; the working directory by default.

    Raises:
      ConfigError: if there is no such gripper, or its description can't be right; names the file and the line's key.
    """
    shipped = shipped_folder()
    name = str(name)
    if re.fullmatch(r"\w+", name):
        path = shipped / f"{name}.yaml"
        if not path.is_file():
            known = [p.stem for p in shipped.glob("*.yaml") if FORMAT in p.read_text("utf-8")]  # others are no grippers
            raise ConfigError(f"gripper={name}: no such gripper{closest(name, known)}; or give a description's path")
    else:
        path = Path(folder) / name
    return _load(path)


def _load(path: Path) -> Gripper:
    try:
        raw = plain_yaml.load(path)
    except (OSError, plain_yaml.PlainYamlError) as error:
        why = getattr(error, "strerror", None) or _one_line(error)
        raise ConfigError(f"{path}: could not read the gripper description: {why}") from error
    gripper = _parse(path, raw)
    _check_against_model(gripper)
    return gripper


def _parse(path: Path, raw: Any) -> Gripper:
    keys = {"format", "name", "model", "fast", "fingers", "object", "parameters"}
    _demand(path, "", raw, keys, optional={"fast"})
    if raw["format"] != FORMAT:
        raise ConfigError(f"{path}: format: must be {FORMAT}")
    fingers, thing = raw["fingers"], raw["object"]
    _demand(path, "fingers.", fingers, {"joints", "actuators", "force_sensors", "closed", "open"})
    _demand(path, "object.", thing, {"joint", "geom", "axis"})
    joints, actuators, force_sensors = (_pair(path, key, fingers) for key in ("joints", "actuators", "force_sensors"))
    if thing["axis"] not in ("x", "y", "z"):
        raise ConfigError(f"{path}: object.axis: must be x, y or z")
    if raw.get("fast", "none") not in ("none", "sphere"):
        raise ConfigError(f"{path}: fast: must be none or sphere")
    parameters = {name: _parameter(path, name, entry) for name, entry in _mapping(path, raw, "parameters").items()}
    for name in SPECIAL:
        if name not in parameters:
            raise ConfigError(f"{path}: parameters.{name}: missing; every gripper needs {', '.join(SPECIAL)}")
    gripper = Gripper(
        name=_text(path, "name", raw["name"]),
        path=path,
        model=path.parent / _text(path, "model", raw["model"]),
        fast=raw.get("fast", "none"),
        joints=joints,
        actuators=actuators,
        force_sensors=force_sensors,
        closed=_number(path, "fingers.closed", fingers["closed"]),
        open=_number(path, "fingers.open", fingers["open"]),
        object_joint=_text(path, "object.joint", thing["joint"]),
        object_geom=_text(path, "object.geom", thing["geom"]),
        axis="xyz".index(thing["axis"]),
        parameters=parameters,
    )
    if gripper.open_m == 0:
        raise ConfigError(f"{path}: fingers.open: must differ from fingers.closed")
    if parameters["radius_m"].low <= 0:
        raise ConfigError(f"{path}: parameters.radius_m.low: must be positive")
    return gripper


def _pair(path: Path, key: str, fingers: dict[str, Any]) -> tuple[str, str]:
    names = fingers[key]
    if not isinstance(names, list) or len(names) != 2 or names[0] == names[1]:
        raise ConfigError(f"{path}: fingers.{key}: must be two names, [left, right]")
    left, right = (_text(path, f"fingers.{key}", name) for name in names)
    return left, right


def _parameter(path: Path, name: str, entry: Any) -> BaseParameter:
    where = f"parameters.{name}."
    _demand(path, where, entry, {"nominal", "low", "high", "unit", "scope", "writes"})
    nominal, low, high = (_number(path, where + key, entry[key]) for key in ("nominal", "low", "high"))
    if not low < nominal < high:
        raise ConfigError(f"{path}: {where}nominal={nominal:g}: must lie between low={low:g} and high={high:g}")
    if entry["scope"] not in _SCOPES:
        raise ConfigError(f"{path}: {where}scope={entry['scope']}: must be one of {', '.join(_SCOPES)}")
    if not isinstance(entry["writes"], list):
        raise ConfigError(f"{path}: {where}writes: must be a list, such as [dof_damping], or []")
    writes = []
    for text in entry["writes"]:
        match = _WRITE.fullmatch(str(text))
        if not match:
            raise ConfigError(f"{path}: {where}writes: {text!r} must look like `actuator_gainprm 0` or `-dof_damping`")
        sign, field, column = match.groups()
        writes.append(FieldWrite(field, None if column is None else int(column), -1.0 if sign else 1.0))
    if not writes and name not in SPECIAL:
        raise ConfigError(f"{path}: {where}writes: must name a field of the model, such as `dof_damping`")
    if writes and name in SPECIAL:
        raise ConfigError(f"{path}: {where}writes: must be []; the simulator knows what {name} is")
    unit = _text(path, f"{where}unit", entry["unit"])
    return BaseParameter(name, nominal, low, high, unit, entry["scope"], tuple(writes))


def _check_against_model(gripper: Gripper) -> None:
    """Finds what the scene does not have, or has the wrong way round, while the description is at hand to be blamed."""
    model = gripper.compile()
    low, high = _TIMESTEP_S
    if not low <= model.opt.timestep <= high:  # which may be NaN
        raise ConfigError(f"{gripper.model}: timestep={model.opt.timestep:g}: must lie in [{low:g}, {high:g}] s")
    for key, kind, count, names in (
        ("fingers.joints", mujoco.mjtObj.mjOBJ_JOINT, model.njnt, gripper.joints),
        ("fingers.actuators", mujoco.mjtObj.mjOBJ_ACTUATOR, model.nu, gripper.actuators),
        ("fingers.force_sensors", mujoco.mjtObj.mjOBJ_SENSOR, model.nsensor, gripper.force_sensors),
        ("object.joint", mujoco.mjtObj.mjOBJ_JOINT, model.njnt, (gripper.object_joint,)),
        ("object.geom", mujoco.mjtObj.mjOBJ_GEOM, model.ngeom, (gripper.object_geom,)),
    ):
        known = [found for found in (mujoco.mj_id2name(model, kind, index) for index in range(count)) if found]
        for name in names:
            if name not in known:
                where = f"{gripper.path}: {key}"
                raise ConfigError(f"{where}: {gripper.model.name} has no {name!r}{closest(name, known)}")
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    for finger in range(2):
        _check_finger(gripper, model, data, finger)
    _check_object(gripper, model, data)
    for parameter in gripper.parameters.values():
        for write in parameter.writes:
            _check_write(f"{gripper.path}: parameters.{parameter.name}.writes: {write.field}", model, write)
    gripper.compile("fast")


def _check_finger(gripper: Gripper, model: mujoco.MjModel, data: mujoco.MjData, finger: int) -> None:
    joint, drive = model.joint(gripper.joints[finger]), model.actuator(gripper.actuators[finger])
    where, axis = f"{gripper.path}: fingers", "xyz"[gripper.axis]
    if joint.type[0] != mujoco.mjtJoint.mjJNT_SLIDE:
        raise ConfigError(f"{where}.joints: {joint.name!r} must be a slide joint")
    side, outward = (("left", -1), ("right", 1))[finger]
    opens = math.copysign(1.0, gripper.open - gripper.closed) * data.xaxis[joint.id][gripper.axis]
    if opens * outward < 0.9:
        raise ConfigError(
            f"{where}.joints: {joint.name!r} must open towards {'-+'[finger]}{axis}, as the {side} finger: swap left"
            " and right, or closed and open, or change object.axis"
        )
    if drive.trntype[0] != mujoco.mjtTrn.mjTRN_JOINT or drive.trnid[0] != joint.id:
        raise ConfigError(f"{where}.actuators: {drive.name!r} must drive the {side} finger's joint {joint.name!r}")
    if drive.gear[0] != 1 or drive.gainprm[0] <= 0 or not math.isclose(drive.biasprm[1], -drive.gainprm[0]):
        raise ConfigError(f"{where}.actuators: {drive.name!r} must be a position servo, such as <position kp='100'>")
    for kind, limited, (low, high) in (
        ("joint", model.jnt_limited[joint.id], joint.range),
        ("actuator", model.actuator_ctrllimited[drive.id], drive.ctrlrange),
    ):
        for key, value in (("closed", gripper.closed), ("open", gripper.open)):
            if limited and not low - 1e-9 <= value <= high + 1e-9:
                raise ConfigError(f"{where}.{key}={value:g}: the {side} {kind} goes from {low:g} to {high:g} m")
    sensor = model.sensor(gripper.force_sensors[finger])
    if not _reads_a_press(model, sensor.id):
        raise ConfigError(
            f"{where}.force_sensors: {sensor.name!r} must be a touch sensor, or a contact sensor with data='force' and"
            " not reduce='netforce': its numbers are summed, and must be positive when the finger presses"
        )


def _reads_a_press(model: mujoco.MjModel, sensor: int) -> bool:
    # A contact sensor's integers: bits of `data`, index of `reduce`. A net force has the world's axes and a sign.
    data, reduce, _ = model.sensor_intprm[sensor]
    kind = model.sensor_type[sensor]
    only_force = data == 1 << int(mujoco.mjtConDataField.mjCONDATA_FORCE) and reduce != _NETFORCE
    return kind == mujoco.mjtSensor.mjSENS_TOUCH or (kind == mujoco.mjtSensor.mjSENS_CONTACT and only_force)


def _check_object(gripper: Gripper, model: mujoco.MjModel, data: mujoco.MjData) -> None:
    where, axis = f"{gripper.path}: object", "xyz"[gripper.axis]
    joint, geom = model.joint(gripper.object_joint), model.geom(gripper.object_geom)
    free = joint.type[0] == mujoco.mjtJoint.mjJNT_FREE
    slides = joint.type[0] == mujoco.mjtJoint.mjJNT_SLIDE and data.xaxis[joint.id][gripper.axis] > 0.9
    if not (free or slides):
        raise ConfigError(f"{where}.joint: {joint.name!r} must be a free joint, or a slide joint towards +{axis}")
    if geom.bodyid[0] != joint.bodyid[0]:
        raise ConfigError(f"{where}.geom: {geom.name!r} must be on the body that {joint.name!r} moves")
    shapes = mujoco.mjtGeom
    if shapes(geom.type[0]) not in (shapes.mjGEOM_CYLINDER, shapes.mjGEOM_SPHERE, shapes.mjGEOM_BOX):
        raise ConfigError(f"{where}.geom: {geom.name!r} must be a cylinder, a sphere or a box, to have a radius")


def _check_write(where: str, model: mujoco.MjModel, write: FieldWrite) -> None:
    field = getattr(model, write.field, None) if write.field in MODEL_FIELDS else None
    if not isinstance(field, np.ndarray) or field.dtype.kind != "f":
        known = [name for name in MODEL_FIELDS if name.startswith(("actuator_", "dof_", "geom_"))]
        raise ConfigError(f"{where} is no field of numbers in MuJoCo's model{closest(write.field, known)}")
    columns = field.shape[1] if field.ndim == 2 else None
    if (columns is None) != (write.column is None) or (columns is not None and write.column >= columns):
        need = "no column" if columns is None else f"a column from 0 to {columns - 1}"
        raise ConfigError(f"{where} needs {need}")


def _mapping(path: Path, raw: dict[str, Any], key: str) -> dict[str, Any]:
    if not isinstance(raw[key], dict):
        raise ConfigError(f"{path}: {key}: must be a mapping")
    return raw[key]


def _demand(path: Path, where: str, raw: Any, keys: Set[str], optional: Set[str] = frozenset()) -> None:
    if not isinstance(raw, dict):
        raise ConfigError(f"{path}: {where.rstrip('.') or 'the file'}: must map {', '.join(sorted(keys))}")
    for key in raw:
        if key not in keys:
            raise ConfigError(f"{path}: {where}{key}: unknown{closest(str(key), keys)}")
    for key in sorted(keys - optional):
        if key not in raw:
            raise ConfigError(f"{path}: {where}{key}: missing")


def _number(path: Path, where: str, value: Any) -> float:
    try:
        if isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value):
            return float(value)
    except OverflowError:
        pass
    hint = "; YAML wants 1.0e-3 for 1e-3" if isinstance(value, str) and "e" in value.lower() else ""
    raise ConfigError(f"{path}: {where}={_one_line(value)[:40]}: must be a number{hint}")


def _text(path: Path, where: str, value: Any) -> str:
    if isinstance(value, str) and len(value) > _LONGEST_TEXT:
        raise ConfigError(f"{path}: {where}: {len(value)} characters; {_LONGEST_TEXT} may be used")
    if not isinstance(value, str) or not value.strip() or not value.isprintable():
        raise ConfigError(f"{path}: {where}={_one_line(value)[:40]}: must be text; put it in quotes")
    return value


def _one_line(message: object) -> str:
    return " ".join(str(message).split())
