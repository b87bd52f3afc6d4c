"""A gripper as data: its MJCF, its motors and fingers, what it reads, and what a fit or a training may change."""

from __future__ import annotations

import copy
import functools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path

import mujoco
import numpy as np

from forcegrasp.errors import ConfigError
from forcegrasp.physics.fast import compile_fast, with_larger_steps
from forcegrasp.physics.gripper_parts import SCOPES, BaseParameter, Channel, FieldWrite, Finger, Motor, Training
from forcegrasp.physics.guard import silence_log
from forcegrasp.physics.opening import OpeningLaw, ground_geoms, measure_opening, straight_law
from forcegrasp.physics.scene_file import check_scene
from forcegrasp.short_repr import ShortRepr, counted, cut

#: Physics tiers, and how much larger than the scene's own their steps may be.
TIERS = {"reference": 1, "fitting": 2, "screening": 4, "fast": 4}
#: Parameters that the simulator itself understands; they need no `writes`.
SPECIAL = ("force_scale", "radius_m", "offset_m")
#: Parameter of a mechanism: how much later than a row's command its readings were taken, s. It needs no `writes`.
SKEW = "readout_skew_s"
#: The same of the forces, where they may be read at another time than the positions.
FORCE_SKEW = "force_skew_s"
#: Parameter of a mechanism: what an effort reads for one N or N·m of the motor, such as a current. Nor does it.
EFFORT_SCALE = "effort_scale"
#: Parameter of a mechanism with one motor: how much faster it moves at a window's start than it was read, unit per s.
START_VELOCITY = "start_velocity"
#: What a set may give of its objects, and no description has: their mass, kg. NaN where it is not given.
MASS = "mass_kg"
#: Parameters that change what is read, and nothing that happens.
OF_READINGS = ("force_scale", EFFORT_SCALE, SKEW, FORCE_SKEW)
#: Parameters of a mechanism that need no `writes`.
KNOWN_TO_REPLAY = (SKEW, EFFORT_SCALE, START_VELOCITY)
SIDES = ("left", "right")
# A motor that moves by less than this share of the largest command step stands against something.
_STALL = 0.1
#: What to do where a policy is asked for and the description says `force: none`.
NO_FORCES = (
    "a policy that controls forces must read some, and this description has none; give a finger a force_sensor, as in"
    " `left: {joint: finger_l, force_sensor: force_l}`, or say `force: motor` to read the motor's effort"
)


@dataclass(frozen=True, repr=False)
class Gripper(ShortRepr):
    """A gripper of one or two motors, with two sides that press on an object, or a mechanism of any; a MuJoCo scene."""

    name: str
    path: Path  #: of the description
    model: Path  #: of the MJCF
    fast: str  #: "sphere" or "none"
    motors: tuple[Motor, ...]  #: one, or left and right
    fingers: tuple[Finger, ...]  #: left, right; none of a mechanism that grasps nothing
    force: str  #: what forces are read from: "sensors", "motor" or "none"
    object_joint: str  #: empty where there are no fingers
    object_geom: str
    axis: int  #: 0, 1, 2 for x, y, z
    period_s: float  #: time between two commands
    max_step: float  #: largest command step, unit of the motors
    parameters: dict[str, BaseParameter]
    training: Training
    #: Sizes of effects in the catalogue are for a stroke and a motor force of 1; these are the gripper's.
    position_scale: float
    force_scale: float
    command: str = "position"  #: what is commanded: "position", "effort" or "voltage"
    unsigned: bool = False  #: whether the motors' efforts are read as sizes without a sign
    #: Numbers of a mechanism's recordings that the scene takes as they are: name → fields that take them.
    settings: Mapping[str, tuple[FieldWrite, ...]] = field(default_factory=dict[str, tuple[FieldWrite, ...]])
    own_steps: bool = (
        False  #: whether fits take the scene's own steps alone, for with larger ones grasps go another way
    )

    def summary(self) -> str:
        return f"{cut(self.name)}, {counted(len(self.parameters), 'parameter')}"

    @property
    def stroke(self) -> float:
        """Position of a fully open motor, m or rad; fully closed is 0."""
        return self.motors[0].stroke

    @property
    def unit(self) -> str:
        """Unit of the motors' positions: "m" or "rad"."""
        return self.motors[0].unit

    @property
    def positions(self) -> tuple[Channel, ...]:
        """What the encoders read, one per motor."""
        return tuple(Channel(f"position{s}", f"q{s}_{self.unit}", self.unit) for s in self._motor_suffixes)

    @property
    def commands(self) -> tuple[Channel, ...]:
        """What is commanded, one per motor."""
        if self.command == "effort":
            what, unit = ("taudes", "nm") if self.unit == "rad" else ("fdes", "n")
            return tuple(Channel(f"command{s}", f"{what}{s}_{unit}", self.effort_unit) for s in self._motor_suffixes)
        if self.command == "voltage":
            return tuple(Channel(f"command{s}", f"udes{s}_v", "V") for s in self._motor_suffixes)
        return tuple(Channel(f"command{s}", f"qdes{s}_{self.unit}", self.unit) for s in self._motor_suffixes)

    @property
    def is_servo(self) -> bool:
        """Whether it is a mechanism without fingers, which grasps nothing."""
        return not self.fingers

    @property
    def sides(self) -> list[tuple[str, Finger]]:
        """The name of each side, left and right, with its finger; none of a mechanism that grasps nothing."""
        return [] if self.is_servo else list(zip(SIDES, self.fingers, strict=True))

    @property
    def latest_reading_s(self) -> float:
        """How much later than its command a sample may have been read, seconds."""
        return max(0.0, self.parameters[SKEW].high) if SKEW in self.parameters else 0.0

    @property
    def effort_unit(self) -> str:
        """Unit of a motor's effort: "N" or "N·m"."""
        return "N·m" if self.unit == "rad" else "N"

    @property
    def forces(self) -> tuple[Channel, ...]:
        """What is read of the forces: one per finger with a sensor, or per motor whose effort is read, or none."""
        if self.is_servo:
            what, unit = ("tau", "nm") if self.unit == "rad" else ("f", "n")
            suffixes = self._motor_suffixes if self.force == "motor" else []
            return tuple(Channel(f"effort{s}", f"{what}{s}_{unit}", self.effort_unit) for s in suffixes)
        if self.force == "motor":
            suffixes = self._motor_suffixes
        else:
            suffixes = [f"_{side[0]}" for side, f in self.sides if f.force_sensor]
        return tuple(Channel(f"force{s}", f"f{s}_n", "N") for s in suffixes)

    @property
    def _motor_suffixes(self) -> list[str]:
        """What tells motors apart in names: left and right of a gripper's, joints of a mechanism's, nothing of one."""
        if len(self.motors) == 1:
            return [""]
        return [f"_{motor.joint}" for motor in self.motors] if self.is_servo else ["_l", "_r"]

    @property
    def is_symmetric(self) -> bool:
        """Whether left and right can be swapped in all that is read and commanded."""
        return len(self.motors) == 2 and len(self.forces) in (0, 2)

    @functools.cached_property
    def is_direct(self) -> bool:
        """Whether each motor slides a finger of its own, so that positions of motors are positions of pads."""
        return not self.is_servo and self._moves_own_fingers and self.unit == "m"

    @property
    def _moves_own_fingers(self) -> bool:
        """Whether fingers stand on the very joints that motors move, each on one of its own."""
        return all(f.motor >= 0 and self.motors[f.motor].joint == f.joint for f in self.fingers)

    @property
    def nominal_gain(self) -> float:
        """Nominal value of the servo gain that a training draws; 0 where it draws none."""
        gain = self.training.servo_gain
        return self.parameters[gain].nominal if gain else 0.0

    @property
    def is_shipped(self) -> bool:
        """Whether it comes with the package, and so is known by its name."""
        return shipped_folder() in (self.path.parent, self.path.parent.parent)

    @property
    def name_or_path(self) -> str:
        """What files say of it, to find it again: its name if it is shipped, else where its description is."""
        return self.path.stem if self.is_shipped else str(self.path.resolve())

    @functools.cached_property
    def opening(self) -> OpeningLaw:
        """How wide the pads stand apart, and how far each moves, at every position of the motors."""
        if self.is_direct or self.is_servo:
            return straight_law(self.stroke)
        return measure_opening(self.spec(), self.motors, self.fingers, self.object_geom, self.axis)

    def pads_at(self, position: np.ndarray) -> np.ndarray | None:
        """How far each side's pads stand from the middle between them, metres; None if they don't move alike.

        Args:
          position: of the motors, ``(n, motors)``.

        Returns:
          ``(n, 2)``, left and right.
        """
        if self.is_direct and len(self.motors) == 2:
            return position
        left, right = self.opening.travel
        one_each = len(self.motors) == 2 and self._moves_own_fingers
        if not math.isclose(left, right, rel_tol=0.01) or (len(self.motors) == 2 and not one_each):
            return None
        half = self.opening.opening_at(position) / 2  # where both motors stand as this one does
        return half if one_each else np.repeat(half, 2, axis=1)

    @functools.cached_property
    def object_is_guided(self) -> bool:
        """Whether the object slides along one axis and can't leave the pads otherwise."""
        if self.is_servo:
            return False
        model = self.compile()
        body = model.geom(self.object_geom).bodyid[0]
        joint = model.joint(self.object_joint)
        return bool(model.body_jntnum[body] == 1 and joint.type[0] == mujoco.mjtJoint.mjJNT_SLIDE)

    @functools.cached_property
    def pads_stay_parallel(self) -> bool:
        """Whether the pads do not turn from open to closed."""
        if self.is_direct or self.is_servo:
            return True
        model = self.compile()
        bodies = [model.body(finger.body).id for finger in self.fingers]

        def axes(qpos: np.ndarray) -> np.ndarray:
            data = mujoco.MjData(model)
            data.qpos[:] = qpos
            mujoco.mj_kinematics(model, data)
            return data.xmat[bodies]

        return bool(np.abs(axes(self.opening.qpos[0]) - axes(self.opening.qpos[-1])).max() < _TURNED)

    @functools.cached_property
    def motor_range(self) -> np.ndarray:
        """Least and largest position that the range of its joint leaves each motor, m or rad, ``(2, motors)``."""
        model, found = self.compile(), np.empty((2, len(self.motors)))
        for index, motor in enumerate(self.motors):
            joint = model.joint(motor.joint)
            limits = joint.range if model.jnt_limited[joint.id] else np.array([-np.inf, np.inf])
            found[:, index] = np.sort(motor.sign * (limits - motor.closed))
        return found

    @property
    def stall(self) -> float:
        """Movement in a control step above which a motor's effort says nothing of contact, m or rad.

        Infinite where forces are read from sensors.
        """
        return _STALL * self.max_step if self.force == "motor" else math.inf

    @functools.cached_property
    def has_velocity_gain(self) -> bool:
        """Whether its servos act on their velocity: MuJoCo's `kv`, in the scene or as a base parameter."""
        model = self.compile()
        gains = [model.actuator(motor.actuator).biasprm[2] for motor in self.motors]
        return self._fits("actuator_biasprm", 2) or any(gains)

    @functools.cached_property
    def has_own_stiffness(self) -> bool:
        """Whether a base parameter gives contacts of each object a stiffness of their own: the first of `solref`."""
        return self._fits("geom_solref", 0, scopes=("object",))

    @functools.cached_property
    def fits_damping(self) -> bool:
        """Whether a base parameter damps the motors: their joints, or by the servos' gain on the velocity.

        The latter is a part of an effort that is read, which damping of the joints is not.
        """
        return self._fits("dof_damping") or (self.force != "motor" and self._fits("actuator_biasprm", 2))

    def _fits(self, field: str, column: int | None = None, scopes: Sequence[str] = SCOPES) -> bool:
        """Whether a base parameter of one of these scopes writes a column of a field of MuJoCo's model."""
        parameters = [parameter for parameter in self.parameters.values() if parameter.scope in scopes]
        return any((write.field, write.column) == (field, column) for p in parameters for write in p.writes)

    @functools.cached_property
    def has_rotors(self) -> bool:
        """Whether positions are commanded to motors that slide a finger each and have inertia of their own besides.

        That is what MuJoCo calls a joint's armature.
        """
        if not self.is_direct or self.command != "position":
            return False
        model, joint_drive = self.compile(), mujoco.mjtTrn.mjTRN_JOINT
        drives = [model.actuator(motor.actuator) for motor in self.motors]
        own = [model.dof_armature[model.joint(motor.joint).dofadr[0]] for motor in self.motors]
        return min(own) > 0 and all(d.trntype[0] == joint_drive and abs(d.gear[0]) == 1 for d in drives)

    @functools.cached_property
    def has_load_behind_rotor(self) -> bool:
        """Whether a servo turns or slides one joint, of whose inertia a part is the rotor's and a part the load's."""
        model = self.compile()
        if not self.is_servo or model.nv != 1:
            return False
        return 0.01 * model.dof_M0[0] < model.dof_armature[0] < 0.99 * model.dof_M0[0]

    @functools.cached_property
    def has_ground(self) -> bool:
        """Whether there is something that the object may stand on."""
        return len(ground_geoms(self.compile(), self.object_geom)) > 0

    @functools.cached_property
    def steps_as_its_drive(self) -> bool:
        """Whether the scene steps at the control period, as its drive samples: half a step would be another drive."""
        return self.compile().opt.timestep > 0.99 * self.period_s

    @property
    def integrators_differ_s(self) -> float:
        """By how much two integrators of the scene may differ in time: a step; not at all where its drive steps so."""
        return 0.0 if self.steps_as_its_drive else float(self.compile().opt.timestep)

    @property
    def shape(self) -> str:
        """What the scene's object is: "cylinder", "sphere" or "box"; empty of a mechanism that grasps nothing."""
        if self.is_servo:
            return ""
        geom = self.compile().geom(self.object_geom)
        return mujoco.mjtGeom(geom.type[0]).name.removeprefix("mjGEOM_").lower()

    def contact_position(self, radius_m: np.ndarray | float) -> np.ndarray:
        """Position of the motors at which the pads meet an object of this radius between them, m or rad."""
        return self.opening.position_at(2 * np.asarray(radius_m, float))

    def compile(self, tier: str = "reference") -> mujoco.MjModel:
        """Returns a copy of the scene's model, with sensors of the contact forces of fingers that have none.

        Args:
          tier: ``"reference"`` is the scene as described; ``"fast"``, where the description has ``fast: sphere``, is
            ``forcegrasp.physics.fast``. The others are for fits, with larger steps of any gripper, and the sphere where
            the description has it: ``"screening"`` tells effects apart, and ``"fitting"``, with at most twice the step,
            has slopes that are exact enough for a fit.

        Raises:
          ConfigError: if there is no such tier, or MuJoCo refuses the scene.
        """
        if tier not in TIERS:
            raise ConfigError(f"physics.tier={tier}: must be reference or fast")
        silence_log()
        if tier not in self._compiled:
            try:
                spec = self.spec()
                if tier != "reference" and self.fast == "sphere":
                    model = compile_fast(spec, self.motors, self.object_geom, self.axis, TIERS[tier])
                elif tier in ("fitting", "screening") and not self.is_servo and not self.steps_as_its_drive:
                    model = with_larger_steps(spec.compile(), self.motors, self.object_geom, TIERS[tier])
                else:
                    model = spec.compile()
                self._compiled[tier] = model
            except (ValueError, RuntimeError) as error:
                raise ConfigError(f"{self.model}: MuJoCo refuses it: {' '.join(str(error).split())}") from error
        return copy.copy(self._compiled[tier])

    @functools.cached_property
    def _compiled(self) -> dict[str, mujoco.MjModel]:
        """Models by tier, never changed: a fit makes plants by the hundred, and to copy is faster than to compile."""
        return {}

    def spec(self) -> mujoco.MjSpec:
        """The scene, to be compiled; what is read and has no sensor in it gets one.

        Raises:
          ConfigError: if the file can't be read.
          ValueError: if MuJoCo refuses it.
        """
        check_scene(self.model)
        spec = mujoco.MjSpec.from_file(str(self.model))
        for side, finger in self.sides:
            if not finger.force_sensor:
                add_contact_sensor(spec, own_sensor(side), self.object_joint, finger.body)
        if self.force == "motor":
            for motor in self.motors:
                spec.add_sensor(
                    name=effort_sensor(motor),
                    type=mujoco.mjtSensor.mjSENS_ACTUATORFRC,
                    objtype=mujoco.mjtObj.mjOBJ_ACTUATOR,
                    objname=motor.actuator,
                )
        return spec


def own_sensor(name: str) -> str:
    """Name of a sensor that the scene does not have and the simulator adds."""
    return f"forcegrasp_{name}"


def effort_sensor(motor: Motor) -> str:
    """Name of the sensor of a motor's effort; not that of a side, though an actuator may be called left."""
    return own_sensor(f"effort_{motor.actuator}")


# Pads turn if an axis of theirs moves by so much.
_TURNED = 0.05
#: Contact points that an added sensor counts.
_CONTACTS = 8


def add_contact_sensor(spec: mujoco.MjSpec, name: str, object_joint: str, finger: str) -> None:
    """Adds a sensor of the normal and tangential forces of each contact between the object and a finger's pads."""
    sensor = spec.add_sensor(
        name=name,
        type=mujoco.mjtSensor.mjSENS_CONTACT,
        objtype=mujoco.mjtObj.mjOBJ_XBODY,
        objname=spec.joint(object_joint).parent.name,
        reftype=mujoco.mjtObj.mjOBJ_XBODY,
        refname=finger,
    )
    sensor.intprm[:3] = 1 << int(mujoco.mjtConDataField.mjCONDATA_FORCE), 0, _CONTACTS


def shipped_folder() -> Path:
    """Where the descriptions that come with the package are."""
    return Path(str(files("forcegrasp") / "assets"))
