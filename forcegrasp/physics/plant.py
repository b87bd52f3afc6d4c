"""Many grasps of one gripper on MuJoCo's batch engine, one physics step at a time, with effects where they act."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from mujoco.batch import Batch

from forcegrasp.physics import guard
from forcegrasp.physics.fast import SPHERE
from forcegrasp.physics.gripper import SIDES, Gripper, effort_sensor, own_sensor
from forcegrasp.physics.gripper_parts import BaseParameter, Finger
from forcegrasp.physics.inertia import inertia_of_radius
from forcegrasp.physics.opening import command_law
from forcegrasp.physics.protocols import PlantEffect
from forcegrasp.physics.sensors import ReadingEffects

# Constraint that holds a finger against dry friction: as stiff as the step allows, lest it creeps under load.
_STIFF_SOLREF = (0.004, 1.0)
_STIFF_SOLIMP = (0.99, 0.9999, 0.001, 0.5, 2.0)


class Plant:
    """Simulates ``n`` grasps, each with its own parameters and effects.

    Parameters are written into per-simulation model fields: nothing is recompiled. Results do not depend on the number
    of threads, on ``n``, or on what a row simulated before, to the last bit; nor on effects at their null values.

    Args:
      gripper: what is simulated.
      n: number of grasps.
      tier: physics tier, see :meth:`~forcegrasp.physics.gripper.Gripper.compile`.
      threads: threads of the engine; 0 uses every core.
      step_factor: multiplies the physics step.
      other_collisions: uses MuJoCo's other collision code, native for libccd or libccd for native.

    Raises:
      ConfigError: if there is no such tier.
    """

    def __init__(
        self,
        gripper: Gripper,
        n: int,
        tier: str = "reference",
        threads: int = 0,
        step_factor: float = 1.0,
        other_collisions: bool = False,
    ) -> None:
        guard.silence_log()
        self.gripper, self.n, self._tier = gripper, n, tier
        self.model = model = gripper.compile(tier)
        model.opt.timestep *= step_factor
        if other_collisions:
            model.opt.disableflags ^= mujoco.mjtDisableBit.mjDSBL_NATIVECCD
        self.dt = float(model.opt.timestep)  #: physics step, seconds
        self._prepare(model)
        self.batch = batch = Batch(model, n, threads)
        self._qpos, self._ctrl, self._sensors = (batch.bind(name) for name in ("qpos", "ctrl", "sensordata"))
        self.motors, self.channels = len(gripper.motors), len(gripper.forces)  #: how many there are
        joints = [model.joint(motor.joint) for motor in gripper.motors]
        #: degrees of freedom of the motors (left, right, or the one), and of the object along the grasp axis
        self.motor_dofs = [joint.dofadr[0] for joint in joints]
        object_joint = model.joint(gripper.object_joint)
        is_free = object_joint.type[0] == mujoco.mjtJoint.mjJNT_FREE
        self._object_qpos = object_joint.qposadr[0] + (gripper.axis if is_free else 0)
        self._object_origin = model.qpos0[self._object_qpos]  # the middle of the grasp is where the scene puts it
        self.object_dof = object_joint.dofadr[0] + (gripper.axis if is_free else 0)
        #: degrees of freedom of everything but the object
        self.gripper_dofs = [i for i in range(model.nv) if model.dof_jntid[i] != object_joint.id]
        self.actuators = [model.actuator(motor.actuator).id for motor in gripper.motors]
        # where motors stand in the engine's arrays: slices, for they are read and written in every step
        self._motor_q = _slice(*(joint.qposadr[0] for joint in joints))
        self._motor_v, self._drives = _slice(*self.motor_dofs), _slice(*self.actuators)
        self._motor_velocity = batch.bind("qvel")[:, self._motor_v]
        self._object_body = model.geom(gripper.object_geom).bodyid[0]
        #: geoms of the object
        self.object_geoms = np.flatnonzero(model.geom_bodyid == self._object_body)
        self._pads = [_Pads.find(model, finger.body) for finger in gripper.fingers]
        self._signs = np.array([motor.sign for motor in gripper.motors])
        self._origins = np.array([motor.closed for motor in gripper.motors])
        self._command_scale, self._command_zero = command_law(gripper.motors, model)
        #: Which motor moves each side, and how far its pads go per unit of it; 0 for a side that stands still.
        self._mover = np.array([max(finger.motor, 0) for finger in gripper.fingers])
        self.travel = np.where([f.motor >= 0 for f in gripper.fingers], gripper.opening.travel, 0.0)
        self._readings = [_reading(model, *pair) for pair in zip(SIDES, gripper.fingers, strict=True)]
        self._efforts = self._effort_readings(model)
        self._felt = [i for i, finger in enumerate(gripper.fingers) if finger.force_sensor]
        self._fields: dict[str, np.ndarray] = {}
        self._base: dict[str, np.ndarray] = {}
        self._friction_active: np.ndarray | None = None  # which motors' friction was stiffened, ``(n, motors)``
        self._effects: list[PlantEffect] = []
        self._hooked: dict[str, list[PlantEffect]] = {}
        self._reading_effects = ReadingEffects([])
        self.force_scale = np.ones(n)  #: f_α, factor from the force sensors to the reading, ``(n,)``
        #: What effects contribute to a step, all together: see :class:`~forcegrasp.physics.protocols.Contribution`.
        self.friction = np.zeros((n, self.motors))
        self.pad_shift_m, self.finger_push_n = np.zeros((2, n, 2))
        self.object_push_n = np.zeros(n)
        self._contributed = (self.friction, self.pad_shift_m, self.finger_push_n, self.object_push_n)
        self.position = np.zeros((n, self.motors))  #: of the motors (left, right, or the one), m or rad; 0 is closed
        #: Sum of each finger's contact forces at the last physics step, before f_α, newtons, ``(n, 2)``.
        self.pad_force = np.zeros((n, 2))
        #: True fingertip forces (left, right): the interaction with the object times f_α, newtons, ``(n, 2)``.
        self.force = np.zeros((n, 2))
        self.transduced_force = np.zeros((n, self.channels))  #: what goes into the force readings, newtons
        #: The same after effects, before noise and rounding: what the force readings say, newtons, ``(n, channels)``.
        self.measured_force = np.zeros((n, self.channels))
        self.measured_position = np.zeros((n, self.motors))  #: what the encoders say, m or rad
        #: What the encoders said when a real gripper was recorded, m or rad, ``(n, motors)``; None if only simulated.
        self.recorded_position: np.ndarray | None = None

    def _effort_readings(self, model: mujoco.MjModel) -> tuple[list[int], np.ndarray]:
        """Where the motors' efforts are read, and the fingertip newtons of each, pressing positive, per unit of it."""
        if self.gripper.force != "motor":
            return [], np.empty(0)
        addresses = [model.sensor(effort_sensor(motor)).adr[0] for motor in self.gripper.motors]
        factors = np.empty(self.motors)
        for index, motor in enumerate(self.gripper.motors):
            drive = model.actuator(motor.actuator)
            length_per_position = self._command_scale[index] * drive.gainprm[0] / -drive.biasprm[1]
            factors[index] = -length_per_position / self.travel[self._moved_by(index)].sum()
        return addresses, factors

    def _prepare(self, model: mujoco.MjModel) -> None:
        """Undoes the compiler's shortcuts past fields that effects change; what is simulated stays the same."""
        # Pads that shift leave the bounding volumes of their bodies, and the midphase would not see them touch.
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_MIDPHASE
        frames = mujoco.mjtSameFrame
        only_rotation = {
            frames.mjSAMEFRAME_BODY.value: frames.mjSAMEFRAME_BODYROT.value,
            frames.mjSAMEFRAME_INERTIA.value: frames.mjSAMEFRAME_INERTIAROT.value,
        }
        bodies = [model.body(finger.body).id for finger in self.gripper.fingers]
        #: Pads in the very frame of their body, whose own position would not be read: field, index, what it must be.
        self._pad_frames = [
            (f"{kind}_sameframe", index, only_rotation[same])
            for kind in ("geom", "site")
            for index, (body, same) in enumerate(
                zip(getattr(model, f"{kind}_bodyid"), getattr(model, f"{kind}_sameframe"), strict=True)
            )
            if body in bodies and same in only_rotation
        ]
        for motor in self.gripper.motors:  # without a limit, a range would not be read
            actuator = model.actuator(motor.actuator).id
            if not model.actuator_forcelimited[actuator]:
                model.actuator_forcelimited[actuator] = 1
                model.actuator_forcerange[actuator] = -np.inf, np.inf

    # --- state ---------------------------------------------------------------------------------------------------

    @property
    def velocity(self) -> np.ndarray:
        """Velocities of the motors, m/s or rad/s, ``(n, motors)``; positive opens."""
        return self._motor_velocity * self._signs

    @property
    def pad_position(self) -> np.ndarray:
        """How far each side's pads stand from where they are when closed, metres, ``(n, 2)``; 0 if they never move."""
        return self.to_sides(self.position)

    def to_sides(self, of_motors: np.ndarray) -> np.ndarray:
        """Displacements of motors ``(..., motors)`` as displacements of the pads they move, metres, ``(..., 2)``."""
        return of_motors if self.gripper.is_direct else of_motors[..., self._mover] * self.travel

    @property
    def object_position(self) -> np.ndarray:
        """Object position along the grasp axis from where the scene puts it, metres, ``(n,)``."""
        return self._qpos[:, self._object_qpos] - self._object_origin

    def presses(self, rows: np.ndarray) -> np.ndarray:
        """Which motors' pads an object pushes against, ``(len(rows), motors)``."""
        touched = self.pad_force[rows] > 0
        if self.gripper.is_direct:
            return touched
        return np.stack([touched[:, self._moved_by(motor)].any(axis=1) for motor in range(self.motors)], axis=1)

    def strongest_press(self, rows: np.ndarray) -> np.ndarray:
        """Most that each side could be pressed with: its servo at full stroke, newtons, ``(len(rows), 2)``."""
        gain = self.field("actuator_gainprm")[rows][:, self.actuators, 0]
        if self.gripper.is_direct:
            return gain * self.gripper.stroke
        reach = [self.travel[self._moved_by(motor)].sum() for motor in range(self.motors)]
        return (gain * self.gripper.stroke / reach)[:, self._mover]

    def _moved_by(self, motor: int) -> np.ndarray:
        return (self._mover == motor) & (self.travel != 0)

    # --- parameters ----------------------------------------------------------------------------------------------

    def field(self, name: str) -> np.ndarray:
        """A per-simulation field of MuJoCo's model, writable, ``(n, ...)``."""
        if name not in self._fields:
            self._fields[name] = self.batch.expand(name)
            self._base[name] = self._fields[name].copy()
        return self._fields[name]

    def base(self, name: str) -> np.ndarray:
        """What :meth:`field` is without effects: the scene's values, and base parameters where they were written."""
        self.field(name)
        return self._base[name]

    def write(self, parameter: BaseParameter, ids: np.ndarray, values: np.ndarray) -> None:
        """Writes a base parameter of these rows into the fields that follow it. ``values``: ``(len(ids),)``."""
        rows = {"actuator": self.actuators, "dof": self.gripper_dofs, "geom": self.object_geoms}
        for write in parameter.writes:
            for row in rows[write.field.split("_")[0]]:
                column = () if write.column is None else (write.column,)
                more = self._more_damping[row] if write.field == "dof_damping" else 0.0
                self._write_base(write.field, (ids, row, *column), write.sign * values + more)

    @functools.cached_property
    def _more_damping(self) -> np.ndarray:
        """What the tier adds to the scene's damping, and so to any that is written, ``(degrees of freedom,)``.

        Few grippers write it, and fits make plants by the hundred: the scene is compiled again only where it counts.
        """
        damping = self.model.dof_damping
        return np.zeros_like(damping) if self._tier == "reference" else damping - self.gripper.compile().dof_damping

    def _write_base(self, field: str, where: tuple[Any, ...], values: np.ndarray) -> None:
        self.field(field)[where] = self.base(field)[where] = values

    def write_radius(self, ids: np.ndarray, radius_m: np.ndarray) -> None:
        """Gives objects a radius (half the width of a box), with the inertia that follows from it at the same mass.

        An object that is more than the one geom, or has an inertia of its own in the scene, keeps its inertia.
        Bounding boxes, radii and inverse weights follow from these: :meth:`reset` has MuJoCo do it.
        """
        model, geom = self.model, self.model.geom(self.gripper.object_geom)
        column = self.gripper.axis if geom.type[0] == mujoco.mjtGeom.mjGEOM_BOX else 0
        self._write_base("geom_size", (ids, geom.id, column), radius_m)
        sphere = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, SPHERE.format(geom.name))
        if sphere >= 0:
            self._write_base("geom_size", (ids, sphere, 0), radius_m)
        as_in_scene = inertia_of_radius(model, self.gripper, geom.size[column : column + 1])
        if np.allclose(as_in_scene, model.body_inertia[self._object_body], rtol=1e-9):
            inertia = inertia_of_radius(model, self.gripper, radius_m)
            self._write_base("body_inertia", (ids, self._object_body), inertia)

    def attach(self, effects: Sequence[tuple[PlantEffect, np.ndarray]]) -> None:
        """Puts effects into the plant, each on its own rows, in the order of their stages; replaces earlier ones."""
        self._effects = [effect.attach(self, rows) for effect, rows in sorted(effects, key=lambda pair: pair[0].rank)]
        hooks = ("change_model", "command", "act", "interaction")
        self._hooked = {hook: [e for e in self._effects if hook in e.hooks()] for hook in hooks}
        self._reading_effects = ReadingEffects(self._effects)

    def reset(self, ids: np.ndarray, offset_m: np.ndarray, position: np.ndarray | None = None) -> None:
        """Starts grasps anew, after their parameters were written.

        Args:
          ids: the rows, ascending.
          offset_m: where their objects stand along the grasp axis, ``(len(ids),)``.
          position: where the motors stand, m or rad, ``(len(ids), motors)``; as in the scene by default.
        """
        for name, field in self._fields.items():  # whatever effects made of it
            field[ids] = self._base[name][ids]
        self._friction_active = None
        which = [np.flatnonzero(np.isin(effect.rows, ids)) for effect in self._effects]
        for effect, of_effect in zip(self._effects, which, strict=True):
            effect.change_model(self, of_effect)
        self.batch.set_const(ids)
        for name, index, frame in self._pad_frames:  # set_const finds them anew
            self.batch.expand(name)[ids, index] = frame
        keyframe = {"keyframe": 0} if self.model.nkey else {}
        self.batch.reset(ids, stage=mujoco.mjtStage.mjSTAGE_NONE.value, **keyframe)
        if position is not None:
            self._place(ids, position)
        self._qpos[ids, self._object_qpos] = self._object_origin + offset_m
        self.batch.forward(ids)
        self.position = self._motors_of(self._qpos)
        self.pad_shift_m[ids] = 0
        for effect, of_effect in zip(self._effects, which, strict=True):
            effect.reset(of_effect)
        self._read_anew(ids)

    def posed(self, position: np.ndarray, object_position: float) -> np.ndarray:
        """Generalised positions of the first row with its motors and its object somewhere else, ``(nq,)``."""
        before = self._qpos[:1].copy()
        self._place(np.arange(1), position[None])
        self._qpos[0, self._object_qpos] = self._object_origin + object_position
        posed = self._qpos[0].copy()
        self._qpos[:1] = before
        return posed

    def _place(self, ids: np.ndarray, position: np.ndarray) -> None:
        """Puts motors somewhere, and with them whatever they move."""
        law = self.gripper.opening
        for dof in self.gripper_dofs if law.qpos.size else ():
            address = self.model.jnt_qposadr[self.model.dof_jntid[dof]]
            mover = self._mover[1] if dof in self._dofs_of_right else self._mover[0]
            self._qpos[ids, address] = np.interp(position[:, mover], law.position, law.qpos[:, address])
        self._qpos[ids, self._motor_q] = position * self._signs + self._origins

    @functools.cached_property
    def _dofs_of_right(self) -> set[int]:
        """Degrees of freedom between the world and the right side's pads."""
        found: set[int] = set()
        body = int(self.model.body(self.gripper.fingers[1].body).id)
        while body:
            first = int(self.model.body_dofadr[body])
            found |= set(range(first, first + int(self.model.body_dofnum[body]))) if first >= 0 else set()
            body = int(self.model.body_parentid[body])
        return found

    # --- time ----------------------------------------------------------------------------------------------------

    def advance(self, command: np.ndarray, steps: int = 1, fresh: np.ndarray | bool = True) -> None:
        """Holds a command for some physics steps.

        Args:
          command: commanded positions, m or rad, ``(n, motors)``.
          steps: number of physics steps.
          fresh: whether the command is a new one, ``(n,)`` or for all.
        """
        if not self._effects:
            self._send(command)
            self.batch.step(nstep=steps)
            self._read()
            return
        fresh = np.broadcast_to(fresh, (self.n,))
        for _ in range(steps):
            self._send(self._through_command(command, fresh))
            self._apply_actions()
            self.batch.step(nstep=1)
            self._read()
            fresh = np.zeros(self.n, bool)

    def play(self, commands: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Holds each command for one physics step, as :meth:`advance` does, in one call of the engine.

        Afterwards only a reset makes sense: what is read is not brought up to date.

        Args:
          commands: commanded positions, m or rad, ``(n, steps, motors)``.

        Returns:
          Positions ``(n, steps, motors)``, force readings ``(n, steps, channels)`` and object positions ``(n, steps)``
          after each step.

        Raises:
          RuntimeError: if there are effects that act in every step; see :attr:`acts_in_steps`.
        """
        if self.acts_in_steps:
            raise RuntimeError("effects act in every step: advance step by step")
        control = np.repeat(self._ctrl[:, None], commands.shape[1], axis=1)
        control[..., self._drives] = commands * self._command_scale + self._command_zero
        record = self.batch.rollout(commands.shape[1], control, record=["qpos", "sensordata"])
        sensors, scale = record["sensordata"], self.force_scale[:, None, None]
        force = self._channels_of(sensors, self._pads_of(sensors) * scale, scale)
        return self._motors_of(record["qpos"]), force, record["qpos"][..., self._object_qpos] - self._object_origin

    @property
    def acts_in_steps(self) -> bool:
        """Whether an effect acts in every step, and not only on the model when a grasp starts."""
        return any(hook != "change_model" for effect in self._effects for hook in effect.hooks())

    def warnings(self) -> np.ndarray:
        """MuJoCo's warning counters, ``(n, kinds)``; all 0 in a sound simulation."""
        return self.batch.warning[..., 1]

    def _motors_of(self, qpos: np.ndarray) -> np.ndarray:
        return (qpos[..., self._motor_q] - self._origins) * self._signs

    def _channels_of(self, sensors: np.ndarray, force: np.ndarray, scale: np.ndarray) -> np.ndarray:
        """What the force channels transduce, newtons, ``(..., channels)``: forces of fingers, or efforts of motors."""
        addresses, factors = self._efforts
        if addresses:
            return sensors[..., addresses] * factors * scale
        return force if len(self._felt) == 2 else force[..., self._felt]

    def _pads_of(self, sensors: np.ndarray) -> np.ndarray:
        # contiguous, lest the order of the sum depend on n
        sums = [np.ascontiguousarray(sensors[..., part]).sum(axis=-1) for part in self._readings]
        return np.stack(sums, axis=-1)

    def _send(self, command: np.ndarray) -> None:
        self._ctrl[:, self._drives] = command * self._command_scale + self._command_zero

    def _through_command(self, command: np.ndarray, fresh: np.ndarray) -> np.ndarray:
        effects = self._hooked["command"]
        if not effects:
            return command
        command = np.array(command, float)
        for effect in effects:
            command[effect.rows] = effect.command(command[effect.rows], fresh[effect.rows])
        return command

    def _apply_actions(self) -> None:
        effects = self._hooked["act"]
        if not effects:
            return
        for total in self._contributed:
            total[:] = 0
        for effect in effects:
            for total, added in zip(self._contributed, effect.act(), strict=True):
                if added is not None:
                    total[effect.rows] += added
        self._write_friction()
        self._write_pad_shift()
        push = self.batch.bind("qfrc_applied")
        push[:, self._motor_v] = self._to_motors(self.finger_push_n) * self._signs
        push[:, self.object_dof] = self.object_push_n

    def _to_motors(self, push_n: np.ndarray) -> np.ndarray:
        """Forces on the pads as what they do to the motors that move them, N or N·m, ``(n, motors)``."""
        if self.gripper.is_direct:
            return push_n
        work = push_n * self.travel
        return np.stack([work[:, self._moved_by(motor)].sum(axis=1) for motor in range(self.motors)], axis=1)

    def _write_friction(self) -> None:
        if not self.friction.any() and "dof_frictionloss" not in self._fields:
            return
        base = self.base("dof_frictionloss")[:, self._motor_v]
        loss = self.field("dof_frictionloss")[:, self._motor_v] = base + self.friction
        active = loss > base
        if self._friction_active is None or not np.array_equal(active, self._friction_active):
            self._friction_active = active
            for dof in self.motor_dofs:
                self.stiffen_friction(dof)

    def stiffen_friction(self, dof: int, rows: np.ndarray | slice = slice(None)) -> None:
        """Lets dry friction that an effect added hold instead of creep, as far as the step allows."""
        more = (self.field("dof_frictionloss") > self.base("dof_frictionloss"))[rows, dof, None]
        for name, stiff in (("dof_solref", _STIFF_SOLREF), ("dof_solimp", _STIFF_SOLIMP)):
            self.field(name)[rows, dof] = np.where(more, stiff, self.base(name)[rows, dof])

    def _write_pad_shift(self) -> None:
        if not self.pad_shift_m.any() and "geom_pos" not in self._fields:
            return
        for side, pads in enumerate(self._pads):
            shift = self.pad_shift_m[:, side : side + 1] * self._outward(side)
            for field, indices in pads.moved.items():
                for index in indices:
                    self.field(field)[:, index] = getattr(self.model, field)[index] + shift

    def _outward(self, side: int) -> np.ndarray:
        """Direction in which a side's pads open, in the frame of their body, ``(3,)`` or ``(n, 3)``."""
        finger = self.gripper.fingers[side]
        if self.gripper.is_direct:
            return self._signs[finger.motor] * self.model.joint(finger.joint).axis
        turned = self.batch.bind("xmat")[:, self._pads[side].body].reshape(-1, 3, 3)
        return turned[:, self.gripper.axis] * (-1.0, 1.0)[side]  # the world's axis, seen from the body

    def _read_anew(self, ids: np.ndarray) -> None:
        """Reads rows that were reset; of the others, readings and the memory of their effects stay as they are."""
        others = np.delete(np.arange(self.n), ids)
        readings = self.measured_position[others], self.measured_force[others]
        kept = [np.flatnonzero(np.isin(effect.rows, others)) for effect in self._effects]
        memories = [{k: v[rows] for k, v in e.state.items()} for e, rows in zip(self._effects, kept, strict=True)]
        self._read()
        self.measured_position[others], self.measured_force[others] = readings
        for effect, rows, memory in zip(self._effects, kept, memories, strict=True):
            for name, values in memory.items():
                effect.state[name][rows] = values

    def _read(self) -> None:
        self.position, self.pad_force = self._motors_of(self._qpos), self._pads_of(self._sensors)
        force = self.pad_force.copy()
        for effect in self._hooked.get("interaction", ()):
            force[effect.rows] = effect.interaction(force[effect.rows])
        scale = self.force_scale[:, None]
        self.force = force * scale
        self.transduced_force = self._channels_of(self._sensors, self.force, scale)
        self.measured_force = self.transduced_force.copy()
        self.measured_position = self.position.copy()
        self._reading_effects.apply(self.measured_position, self.measured_force)


@dataclass(frozen=True)
class _Pads:
    """What moves with a side's pads, in the frame of their body."""

    body: int
    moved: dict[str, np.ndarray]  #: field of positions → indices

    @classmethod
    def find(cls, model: mujoco.MjModel, name: str) -> _Pads:
        body = int(model.body(name).id)
        moved = {
            "geom_pos": np.flatnonzero(model.geom_bodyid == body),
            "site_pos": np.flatnonzero(model.site_bodyid == body),
            "body_pos": np.flatnonzero(model.body_parentid == body),
        }
        return cls(body, moved)


def _reading(model: mujoco.MjModel, side: str, finger: Finger) -> slice:
    """Where the numbers stand whose sum is a side's force; of sensors that were added, the normal forces alone."""
    sensor = model.sensor(finger.force_sensor or own_sensor(side))
    return slice(sensor.adr[0], sensor.adr[0] + sensor.dim[0], 1 if finger.force_sensor else 3)


def _slice(one: int, other: int | None = None) -> slice:
    """The slice that holds these indices, in this order."""
    if other is None:
        return slice(int(one), int(one) + 1)
    step = int(other - one)
    end = int(other) + (1 if step > 0 else -1)
    return slice(int(one), None if end < 0 else end, step)


def write_base(plant: Plant, ids: np.ndarray, values: Mapping[str, np.ndarray]) -> np.ndarray:
    """Writes base parameters by name; returns the objects' offsets, which only :meth:`Plant.reset` can set.

    Args:
      ids: the rows.
      values: parameter → ``(len(ids),)``; those that are missing stay as they are.
    """
    for name, value in values.items():
        if name == "force_scale":
            plant.force_scale[ids] = value
        elif name == "radius_m":
            plant.write_radius(ids, value)
        elif name != "offset_m":
            plant.write(plant.gripper.parameters[name], ids, value)
    return values.get("offset_m", np.zeros(len(ids)))
