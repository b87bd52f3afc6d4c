"""Reads the description of a gripper, as YAML; what it does not say follows from the scene."""

# pyright: standard

from __future__ import annotations

import dataclasses
import functools
import math
import re
from collections.abc import Mapping, Set
from pathlib import Path
from typing import Any

import mujoco

from forcegrasp.assets import DEFAULT_GRIPPER
from forcegrasp.errors import ConfigError, closest
from forcegrasp.files import plain_yaml
from forcegrasp.physics.gripper import SIDES, SPECIAL, Gripper, shipped_folder
from forcegrasp.physics.gripper_checks import check_gripper
from forcegrasp.physics.gripper_defaults import training_of_scene
from forcegrasp.physics.gripper_parts import BaseParameter, FieldWrite, Finger, Motor, Training
from forcegrasp.physics.guard import silence_log
from forcegrasp.physics.scene_file import check_scene

FORMAT, FIRST_FORMAT = "forcegrasp-gripper/2", "forcegrasp-gripper/1"
_WRITE = re.compile(r"(-?)((?:actuator|dof|geom)_\w+)(?: (\d+))?")
_LONGEST_TEXT = 200
_SCOPES = ("gripper", "object", "grasp")
#: Time between two commands where a description does not say; largest command step, as a share of the stroke.
_PERIOD_S, _STEP = 0.04, 1 / 15


def load_gripper(name: str | Path, folder: str | Path = "") -> Gripper:
    """Returns a gripper by name (see :func:`shipped_grippers`) or by the path of its description.

    Args:
      name: what ``gripper:`` says in a measurement set.
      folder: where a relative path starts; the working directory by default.

    Raises:
      ConfigError: if there is no such gripper, or its description can't be right; names the file and the line's key.
    """
    name = str(name)
    if re.fullmatch(r"\w+", name):
        known = shipped_grippers()
        if name not in known:
            raise ConfigError(f"gripper={name}: no such gripper{closest(name, known)}; or give a description's path")
        return _load(shipped_folder() / f"{name}.yaml")
    return _load(Path(folder) / name)


@functools.cache
def default_gripper() -> Gripper:
    """The gripper that is simulated where no other is named: the paper's."""
    return load_gripper(DEFAULT_GRIPPER)


def shipped_grippers() -> list[str]:
    """Names of the grippers that come with the package."""
    return sorted(p.stem for p in shipped_folder().glob("*.yaml") if p.with_suffix(".xml").is_file())


def _load(path: Path) -> Gripper:
    try:
        raw = plain_yaml.load(path)
    except (OSError, plain_yaml.PlainYamlError) as error:
        why = getattr(error, "strerror", None) or _one_line(error)
        raise ConfigError(f"{path}: could not read the gripper description: {why}") from error
    first = isinstance(raw, dict) and raw.get("format") == FIRST_FORMAT
    if isinstance(raw, dict) and "format" in raw and raw["format"] not in (FORMAT, FIRST_FORMAT):
        raise ConfigError(f"{path}: format: must be {FORMAT}; {FIRST_FORMAT} is read, too")
    keys = {"format", "name", "model", "fast", "fingers", "object", "parameters"}
    _demand(path, "", raw, keys | (set() if first else _SECOND_KEYS), optional={"fast"} | _OPTIONAL_KEYS)
    gripper = _parse(path, _of_first_format(path, raw) if first else raw)
    check_gripper(gripper, _FIRST_NAMES if first else _NAMES)
    return dataclasses.replace(gripper, training=_training(path, gripper, raw.get("training")))


_SECOND_KEYS = {"motors", "force", "control", "training", "scale"}
_OPTIONAL_KEYS = {"force", "control", "training", "scale"}
#: What messages call the parts of a description.
_NAMES = {"joint": "motors.joint", "actuator": "motors.actuator", "closed": "motors.closed", "open": "motors.open",
          "sensor": "fingers.force_sensor"}  # fmt: skip
_FIRST_NAMES = {"joint": "fingers.joints", "actuator": "fingers.actuators", "closed": "fingers.closed",
                "open": "fingers.open", "sensor": "fingers.force_sensors"}  # fmt: skip


def _of_first_format(path: Path, raw: dict[str, Any]) -> dict[str, Any]:
    """A description of the first format in the words of the second."""
    fingers = raw["fingers"]
    _demand(path, "fingers.", fingers, {"joints", "actuators", "force_sensors", "closed", "open"})
    joints, actuators, sensors = (_pair(path, key, fingers) for key in ("joints", "actuators", "force_sensors"))
    for key in ("closed", "open"):
        _number(path, f"fingers.{key}", fingers[key])
    if fingers["closed"] == fingers["open"]:
        raise ConfigError(f"{path}: fingers.open: must differ from fingers.closed")
    ends = {key: fingers[key] for key in ("closed", "open")}
    motors = [{"joint": j, "actuator": a} | ends for j, a in zip(joints, actuators, strict=True)]
    sides = {
        side: {"joint": joint, "force_sensor": sensor}
        for side, joint, sensor in zip(SIDES, joints, sensors, strict=True)
    }
    kept = {key: raw[key] for key in ("name", "model", "fast", "object", "parameters") if key in raw}
    return kept | {"motors": motors, "fingers": sides, "scale": {"position": 1.0, "force": 1.0}}


def _parse(path: Path, raw: dict[str, Any]) -> Gripper:
    grasped = raw["object"]
    _demand(path, "object.", grasped, {"joint", "geom", "axis"})
    if grasped["axis"] not in ("x", "y", "z"):
        raise ConfigError(f"{path}: object.axis: must be x, y or z")
    if raw.get("fast", "none") not in ("none", "sphere"):
        raise ConfigError(f"{path}: fast: must be none or sphere")
    parameters = {name: _parameter(path, name, entry) for name, entry in _mapping(path, raw, "parameters").items()}
    for name in SPECIAL:
        if name not in parameters:
            raise ConfigError(f"{path}: parameters.{name}: missing; every gripper needs {', '.join(SPECIAL)}")
    if parameters["radius_m"].low <= 0:
        raise ConfigError(f"{path}: parameters.radius_m.low: must be positive")
    model = path.parent / _text(path, "model", raw["model"])
    control = raw.get("control") or {}
    _demand(path, "control.", control, {"period_s", "max_step"}, optional={"period_s", "max_step"})
    scale = raw.get("scale") or {}
    _demand(path, "scale.", scale, {"position", "force"}, optional={"position", "force"})
    if not isinstance(raw["motors"], list) or len(raw["motors"]) not in (1, 2):
        raise ConfigError(f"{path}: motors: must be a list of one motor, or of two (left, right)")
    motors = tuple(_motor(path, f"motors[{i}].", entry) for i, entry in enumerate(raw["motors"]))
    strokes = [m.stroke for m in motors]
    if not math.isclose(strokes[0], strokes[-1]):
        raise ConfigError(f"{path}: motors: open and closed must be as far apart in both")
    fingers = raw["fingers"]
    _demand(path, "fingers.", fingers, set(SIDES))
    sides = [_finger(path, f"fingers.{side}.", fingers[side]) for side in SIDES]
    force = raw.get("force", "sensors" if any(f.force_sensor for f in sides) else "none")
    if force not in ("sensors", "motor", "none"):
        raise ConfigError(f"{path}: force={force}: must be sensors, motor or none")
    if (force == "sensors") != any(f.force_sensor for f in sides):
        raise ConfigError(f"{path}: force={force}: `sensors` needs a finger with a force_sensor, the others need none")
    gripper = Gripper(
        name=_text(path, "name", raw["name"]),
        path=path,
        model=model,
        fast=raw.get("fast", "none"),
        motors=motors,
        fingers=(sides[0], sides[1]),
        force=force,
        object_joint=_text(path, "object.joint", grasped["joint"]),
        object_geom=_text(path, "object.geom", grasped["geom"]),
        axis="xyz".index(grasped["axis"]),
        period_s=_positive(path, "control.period_s", control.get("period_s", _PERIOD_S)),
        max_step=_positive(path, "control.max_step", control.get("max_step", strokes[0] * _STEP)),
        parameters=parameters,
        training=_NO_TRAINING,
        position_scale=_positive(path, "scale.position", scale.get("position", strokes[0] / _STROKE)),
        force_scale=_positive(path, "scale.force", scale.get("force", 1.0)),
    )
    return _in_scene(gripper)


#: Stroke for which the sizes of effects in the catalogue are typical; metres, or as many radians.
_STROKE = 0.05
_NO_TRAINING = Training((0, 0), (0, 0), (0, 0), (0, 0), 0, 0, 0, {}, "", (0, 0), 0, 0, 0, 0, 0)


def _motor(path: Path, where: str, entry: Any) -> Motor:
    _demand(path, where, entry, {"joint", "actuator", "closed", "open"})
    closed, opened = (_number(path, where + key, entry[key]) for key in ("closed", "open"))
    if closed == opened:
        raise ConfigError(f"{path}: {where}open: must differ from {where}closed")
    actuator, joint = (_text(path, where + key, entry[key]) for key in ("actuator", "joint"))
    return Motor(actuator, joint, closed, opened, "m")


def _finger(path: Path, where: str, entry: Any) -> Finger:
    _demand(path, where, entry, {"joint", "body", "force_sensor"}, optional={"joint", "body", "force_sensor"})
    if ("joint" in entry) == ("body" in entry):
        raise ConfigError(f"{path}: {where.rstrip('.')}: needs the joint that moves it, or the body of its pads")
    sensor = "" if entry.get("force_sensor") is None else _text(path, f"{where}force_sensor", entry["force_sensor"])
    key = "joint" if "joint" in entry else "body"
    name = _text(path, where + key, entry[key])
    return Finger(name if key == "body" else "", name if key == "joint" else "", -1, sensor)


def _in_scene(gripper: Gripper) -> Gripper:
    """Fills in what names of the scene stand for: units of motors, bodies of fingers, and what moves them."""
    silence_log()
    check_scene(gripper.model)
    try:
        model = mujoco.MjSpec.from_file(str(gripper.model)).compile()
    except (ValueError, RuntimeError) as error:
        raise ConfigError(f"{gripper.model}: MuJoCo refuses it: {_one_line(error)}") from error
    joints = {model.joint(i).name: i for i in range(model.njnt)}
    hinge = mujoco.mjtJoint.mjJNT_HINGE
    units = ["rad" if m.joint in joints and model.jnt_type[joints[m.joint]] == hinge else "m" for m in gripper.motors]
    motors = tuple(dataclasses.replace(m, unit=u) for m, u in zip(gripper.motors, units, strict=True))
    fingers = []
    for side, finger in enumerate(gripper.fingers):
        if finger.joint:
            if finger.joint not in joints:
                fingers.append(finger)
                continue
            body = int(model.jnt_bodyid[joints[finger.joint]])
            finger = dataclasses.replace(finger, body=model.body(body).name)
        else:
            found = [i for i in range(model.nbody) if model.body(i).name == finger.body]
            body = found[0] if found else 0
        moved_by = _joints_below(model, body)
        own = [i for i, m in enumerate(gripper.motors) if joints.get(m.joint) in moved_by]
        motor = own[0] if own else (min(side, len(motors) - 1) if moved_by else -1)
        joint = model.joint(moved_by[0]).name if moved_by else ""
        fingers.append(dataclasses.replace(finger, joint=finger.joint or joint, motor=motor))
    return dataclasses.replace(gripper, motors=motors, fingers=(fingers[0], fingers[1]))


def _joints_below(model: mujoco.MjModel, body: int) -> list[int]:
    """Joints between a body and the world, the nearest first."""
    found: list[int] = []
    while body:
        first = model.body_jntadr[body]
        found += range(first, first + model.body_jntnum[body]) if first >= 0 else []
        body = model.body_parentid[body]
    return found


# --- training -----------------------------------------------------------------------------------------------------


def _training(path: Path, gripper: Gripper, raw: Any) -> Training:
    raw = {} if raw is None else raw
    known = {f.name for f in dataclasses.fields(Training)}
    _demand(path, "training.", raw, known, optional=known)
    values: dict[str, Any] = {}
    for key, value in raw.items():
        where, like = f"training.{key}", getattr(_NO_TRAINING, key)
        if key == "softness":
            ends = _map(path, where, value)
            values[key] = {name: _range(path, f"{where}.{name}", v, ordered=False) for name, v in ends}
            unknown = set(values[key]) - set(gripper.parameters)
        elif key == "servo_gain":
            values[key], unknown = _text(path, where, value), {value} - set(gripper.parameters)
        else:
            values[key] = _range(path, where, value) if isinstance(like, tuple) else _number(path, where, value)
            unknown = set()
        if unknown:
            name = str(min(unknown))
            raise ConfigError(f"{path}: {where}: no parameter {name!r}{closest(name, gripper.parameters)}")
    return training_of_scene(gripper, values)


def _map(path: Path, where: str, value: Any) -> list[tuple[str, Any]]:
    if not isinstance(value, dict):
        raise ConfigError(f"{path}: {where}: must map parameters to [hard, soft]")
    return list(value.items())


def _range(path: Path, where: str, value: Any, ordered: bool = True) -> tuple[float, float]:
    if not isinstance(value, list) or len(value) != 2:
        raise ConfigError(f"{path}: {where}: must be two numbers in brackets")
    low, high = (_number(path, where, number) for number in value)
    if ordered and low > high:
        raise ConfigError(f"{path}: {where}: must be [low, high] with low ≤ high")
    return low, high


# --- parts ---------------------------------------------------------------------------------------------------------


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


def _mapping(path: Path, raw: Mapping[str, Any], key: str) -> dict[str, Any]:
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


def _positive(path: Path, where: str, value: Any) -> float:
    number = _number(path, where, value)
    if number <= 0:
        raise ConfigError(f"{path}: {where}={number:g}: must be positive")
    return number


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
