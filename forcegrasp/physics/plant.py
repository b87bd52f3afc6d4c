"""Many grasps of one gripper on MuJoCo's batch engine, one physics step at a time, with effects where they act."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from typing import Any

import mujoco
import numpy as np
from mujoco.batch import Batch

from forcegrasp.physics import guard
from forcegrasp.physics.attached_effects import AttachedEffects
from forcegrasp.physics.fast import SPHERE
from forcegrasp.physics.gripper import OF_READINGS, START_VELOCITY, Gripper
from forcegrasp.physics.gripper_parts import BaseParameter
from forcegrasp.physics.inertia import inertia_of_radius
from forcegrasp.physics.protocols import PlantEffect
from forcegrasp.physics.scene_layout import SceneLayout

# Constraint that holds a finger against dry friction: as stiff as the step allows, lest it creeps under load.
_STIFF_SOLREF = (0.004, 1.0)
_STIFF_SOLIMP = (0.99, 0.9999, 0.001, 0.5, 2.0)

# What motor_force and outside_force are made of.
_FORCES = ("qfrc_actuator", "qfrc_spring", "qfrc_bias")


class Plant(SceneLayout):
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
        self.n, self._tier = n, tier
        model = gripper.compile(tier)
        model.opt.timestep *= step_factor
        if other_collisions:
            model.opt.disableflags ^= mujoco.mjtDisableBit.mjDSBL_NATIVECCD
        self.dt = float(model.opt.timestep)  #: physics step, seconds
        super().__init__(gripper, model)
        self._prepare(model)
        self.batch = batch = Batch(model, n, threads)
        self._qpos, self._ctrl, self._sensors = (batch.bind(name) for name in ("qpos", "ctrl", "sensordata"))
        self._qvel = batch.bind("qvel")
        self._fields: dict[str, np.ndarray] = {}
        self._base: dict[str, np.ndarray] = {}
        self._load, self._enabled = np.zeros(n), np.ones(n, bool)
        self._at_start = np.ones(n, bool)  # which rows made no step since they were reset
        self._force_range: np.ndarray | None = None  # of the motors, before it was changed while they move
        self._friction_active: np.ndarray | None = None  # which motors' friction was stiffened, ``(n, motors)``
        self.effects = AttachedEffects(())
        self.force_scale = np.ones(n)  #: f_α, factor from the force sensors to the reading, ``(n,)``
        #: What effects contribute to a step, all together: see :class:`~forcegrasp.physics.protocols.Contribution`.
        self.friction, self.damping, self.motor_push = np.zeros((3, n, self.motors))
        self.pad_shift_m, self.finger_push_n = np.zeros((2, n, 2))
        self.object_push_n = np.zeros(n)
        pushes = self.finger_push_n, self.object_push_n, self.damping, self.motor_push
        self._contributed = (self.friction, self.pad_shift_m, *pushes)
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
        return self._qvel[:, self._motor_v] * self._signs

    @property
    def inertia(self) -> np.ndarray:
        """Inertia that each motor moves where the scene puts it, kg or kg·m², ``(n, motors)``."""
        return self.batch.expand("dof_M0")[:, self._motor_v]

    @property
    def motor_force(self) -> np.ndarray:
        """What the motors gave in the last physics step, N or N·m, ``(n, motors)``; 0 before the first one."""
        given = self.batch.bind("qfrc_actuator")[:, self._motor_v] * self._signs
        return np.where(self._at_start[:, None], 0.0, given)

    @property
    def outside_force(self) -> np.ndarray:
        """What acts on the motors' joints from outside, N or N·m, ``(n, motors)``; positive opens.

        Gravity, springs, a load and what presses against the pads; not friction, and not what effects push.
        """
        weight = self.batch.bind("qfrc_spring") - self.batch.bind("qfrc_bias")
        return weight[:, self._motor_v] * self._signs + self._to_motors(self.pad_force) + self._load[:, None]

    @property
    def pad_position(self) -> np.ndarray:
        """How far each side's pads stand from where they are when closed, metres, ``(n, 2)``; 0 if they never move."""
        return self.to_sides(self.position)

    @property
    def object_position(self) -> np.ndarray:
        """Object position along the grasp axis from where the scene puts it, metres, ``(n,)``."""
        return self._object_of(self._qpos)

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
        joints = [motor.joint for motor in self.gripper.motors]
        for write in parameter.writes:
            kind = write.field.split("_")[0]
            own = (
                [(self.actuators if kind == "actuator" else self.motor_dofs)[joints.index(write.joint)]]
                if write.joint
                else []
            )
            for row in own or rows[kind]:
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
        for field, where, values in self._radius_fields(ids, radius_m):
            self._write_base(field, where, values)

    def change_radius(self, ids: np.ndarray, change_m: np.ndarray) -> None:
        """Makes objects larger than base parameters say, until the next reset; a tenth of the radius is left at least.

        For an effect's ``change_model``. ``change_m``: ``(len(ids),)``.
        """
        geom = self.model.geom(self.gripper.object_geom)
        radius = self.base("geom_size")[ids, geom.id, self._radius_column]
        for field, where, values in self._radius_fields(ids, np.maximum(radius + change_m, radius / 10)):
            self.field(field)[where] = values

    @property
    def _radius_column(self) -> int:
        is_box = self.model.geom(self.gripper.object_geom).type[0] == mujoco.mjtGeom.mjGEOM_BOX
        return self.gripper.axis if is_box else 0

    def _radius_fields(self, ids: np.ndarray, radius_m: np.ndarray) -> list[tuple[str, tuple[Any, ...], np.ndarray]]:
        """Fields that follow an object's radius: name, where, and what they become."""
        model, geom, column = self.model, self.model.geom(self.gripper.object_geom), self._radius_column
        fields: list[tuple[str, tuple[Any, ...], np.ndarray]] = [("geom_size", (ids, geom.id, column), radius_m)]
        sphere = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, SPHERE.format(geom.name))
        if sphere >= 0:
            fields.append(("geom_size", (ids, sphere, 0), radius_m))
        as_in_scene = inertia_of_radius(model, self.gripper, geom.size[column : column + 1])
        if np.allclose(as_in_scene, model.body_inertia[self._object_body], rtol=1e-9):
            inertia = inertia_of_radius(model, self.gripper, radius_m)
            fields.append(("body_inertia", (ids, self._object_body), inertia))
        return fields

    def attach(self, effects: Sequence[tuple[PlantEffect, np.ndarray]]) -> None:
        """Puts effects into the plant, each on its own rows, in the order of their stages; replaces earlier ones."""
        ranked = sorted(effects, key=lambda pair: pair[0].rank)
        self.effects = AttachedEffects([effect.attach(self, rows) for effect, rows in ranked])
        for name in _FORCES if self.effects.act_in_steps else ():
            self.batch.bind(name)  # the engine copies it from its next call on

    def reset(
        self,
        ids: np.ndarray,
        offset_m: np.ndarray,
        position: np.ndarray | None = None,
        velocity: np.ndarray | None = None,
    ) -> None:
        """Starts grasps anew, after their parameters were written.

        Args:
          ids: the rows, ascending.
          offset_m: where their objects stand along the grasp axis, ``(len(ids),)``.
          position: where the motors stand, m or rad, ``(len(ids), motors)``; as in the scene by default.
          velocity: of the motors, m/s or rad/s, ``(len(ids), motors)``; they stand still by default.
        """
        for name, field in self._fields.items():  # whatever effects made of it
            field[ids] = self._base[name][ids]
        self._friction_active = None
        self.effects.change_model(self, ids)
        self.batch.set_const(ids)
        for name, index, frame in self._pad_frames:  # set_const finds them anew
            self.batch.expand(name)[ids, index] = frame
        keyframe = {"keyframe": 0} if self.model.nkey else {}
        self.batch.reset(ids, stage=mujoco.mjtStage.mjSTAGE_NONE.value, **keyframe)
        if position is not None:
            self._place(ids, position)
        if velocity is not None:
            self._qvel[ids[:, None], self.motor_dofs] = velocity * self._signs
        if not self.gripper.is_servo:
            self._qpos[ids, self._object_qpos] = self._object_origin + offset_m
        if self._force_range is not None:
            self._force_range[ids] = self.field("actuator_forcerange")[ids][:, self.actuators]
        self._enabled[ids] = self._at_start[ids] = True
        self.batch.forward(ids)
        self.position = self._motors_of(self._qpos)
        self.pad_shift_m[ids] = 0
        self.effects.reset(ids)
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
        self._qpos[ids[:, None], self._motor_qpos] = position * self._signs + self._origins

    # --- time ----------------------------------------------------------------------------------------------------

    def advance(self, command: np.ndarray, steps: int = 1, fresh: np.ndarray | bool = True) -> None:
        """Holds a command for some physics steps.

        Args:
          command: commanded positions, m or rad, ``(n, motors)``.
          steps: number of physics steps.
          fresh: whether the command is a new one, ``(n,)`` or for all.
        """
        if not len(self.effects):
            self._send(command)
            self.batch.step(nstep=steps)
            self._read()
            return
        fresh = np.broadcast_to(fresh, (self.n,))
        for _ in range(steps):
            self._send(self.effects.command(command, fresh))
            self._apply_actions()
            self.batch.step(nstep=1)
            self._at_start[:] = False
            self._read()
            fresh = np.zeros(self.n, bool)

    def disturb(self, load: np.ndarray, enabled: np.ndarray) -> None:
        """Says what acts on the motors from outside until the next call.

        Args:
          load: force or torque on each motor, N or N·m, ``(n,)``; positive opens.
          enabled: whether the motors are switched on, ``(n,)``.
        """
        self._load = load
        self.batch.bind("qfrc_applied")[:, self._motor_v] = load[:, None] * self._signs
        self._enabled = np.array(enabled, bool)
        self._write_force_range()

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
        return self._motors_of(record["qpos"]), force, self._object_of(record["qpos"])

    @property
    def acts_in_steps(self) -> bool:
        """Whether an effect acts in every step, and not only on the model when a grasp starts."""
        return self.effects.act_in_steps

    def warnings(self) -> np.ndarray:
        """MuJoCo's warning counters, ``(n, kinds)``; all 0 in a sound simulation."""
        return self.batch.warning[..., 1]

    def _send(self, command: np.ndarray) -> None:
        self._ctrl[:, self._drives] = command * self._command_scale + self._command_zero

    def _write_force_range(self) -> None:
        """Limits the motors as effects say, and holds still those that are switched off."""
        ranges = self.field("actuator_forcerange")
        if self._force_range is None:
            self._force_range = ranges[:, self.actuators].copy()
        allowed = self._force_range
        if self.effects.limit_motors:
            turned = self._drive_signs < 0  # those whose force closes where it is positive
            low, high = allowed[..., 0], allowed[..., 1]
            low, high = np.where(turned, -high, low), np.where(turned, -low, high)
            low, high = self.effects.motor_range(low, high)
            allowed = np.stack([np.where(turned, -high, low), np.where(turned, -low, high)], axis=-1)
        ranges[:, self.actuators] = np.where(self._enabled[:, None, None], allowed, 0.0)

    def _apply_actions(self) -> None:
        if self.effects.limit_motors:
            self._write_force_range()
        if not self.effects.contribute(self._contributed):
            return
        self._write_friction()
        self._write_damping()
        self._write_pad_shift()
        push = self.batch.bind("qfrc_applied")
        on_motors = self._to_motors(self.finger_push_n) + self.motor_push + self._load[:, None]
        push[:, self._motor_v] = on_motors * self._signs
        if not self.gripper.is_servo:
            push[:, self.object_dof] = self.object_push_n

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

    def _write_damping(self) -> None:
        if self.damping.any() or "dof_damping" in self._fields:
            self.field("dof_damping")[:, self._motor_v] = self.base("dof_damping")[:, self._motor_v] + self.damping

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
        with self.effects.kept(others):
            self._read()
        self.measured_position[others], self.measured_force[others] = readings

    def _read(self) -> None:
        self.position, self.pad_force = self._motors_of(self._qpos), self._pads_of(self._sensors)
        scale = self.force_scale[:, None]
        self.force = self.effects.interaction(self.pad_force) * scale
        self.transduced_force = self._channels_of(self._sensors, self.force, scale)
        self.measured_force = self.transduced_force.copy()
        self.measured_position = self.position.copy()
        self.effects.readings.apply(self.measured_position, self.measured_force)


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
        elif name not in ("offset_m", START_VELOCITY, *OF_READINGS):
            plant.write(plant.gripper.parameters[name], ids, value)
    return values.get("offset_m", np.zeros(len(ids)))
