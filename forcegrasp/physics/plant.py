"""Many grasps of one gripper on MuJoCo's batch engine, one physics step at a time, with effects where they act."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import mujoco
import numpy as np

from forcegrasp.physics.attached_effects import AttachedEffects
from forcegrasp.physics.contact_law import contact_numbers
from forcegrasp.physics.contributed_fields import ContributedFields
from forcegrasp.physics.gripper import MASS, OF_READINGS, START_VELOCITY, Gripper
from forcegrasp.physics.places import places
from forcegrasp.physics.protocols import PlantEffect

# What motor_force and outside_force are made of.
_FORCES = ("qfrc_actuator", "qfrc_spring", "qfrc_bias")
# What effects contribute that is pushed with besides what the engine knows of.
_PUSHES = ("finger_push_n", "object_push_n", "motor_push")


# Numbers of sensors that :meth:`Plant.play` asks of the engine at a time: many, but no more than a core keeps at hand.
_NUMBERS_AT_ONCE = 1_000_000


class Plant(ContributedFields):
    """Simulates ``n`` grasps, each with its own parameters and effects.

    Results do not depend on the number of threads, on ``n``, or on what a row simulated before, to the last bit; nor on
    effects at their null values.

    Args and errors as :class:`~forcegrasp.physics.model_fields.ModelFields` has them.
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
        super().__init__(gripper, n, tier, threads, step_factor, other_collisions)
        self._qpos, self._ctrl, self._sensors = (self.batch.bind(name) for name in ("qpos", "ctrl", "sensordata"))
        self._qvel, self._applied = self.batch.bind("qvel"), self.batch.bind("qfrc_applied")
        self._load, self._enabled = np.zeros(n), np.ones(n, bool)
        self._pushed = False  # whether effects pushed in the last step
        self._running: np.ndarray | None = None  # which rows steps advance, ascending; all by default
        self._at_start = np.ones(n, bool)  # which rows made no step since they were reset
        self._force_range: np.ndarray | None = None  # of the motors, before it was changed while they move
        self.force_scale = np.ones(n)  #: f_α, factor from the force sensors to the reading, ``(n,)``
        #: of the joints that motors move, m or rad, ``(n, motors)``; an effect may let a motor be somewhere else
        self.joint_position = np.zeros((n, self.motors))
        self.position = self.joint_position  #: of the motors (left, right, or the one), m or rad; 0 is closed
        #: Sum of each finger's contact forces at the last physics step, before f_α, newtons, ``(n, 2)``.
        self.pad_force = np.zeros((n, 2))
        #: The same with what effects in the contact press, ``(n, 2)``.
        self.press_n = np.zeros((n, 2))
        #: True fingertip forces (left, right): the interaction with the object times f_α, newtons, ``(n, 2)``.
        self.force = np.zeros((n, 2))
        self.transduced_force = np.zeros((n, self.channels))  #: what goes into the force readings, newtons
        #: The same after effects, before noise and rounding: what the force readings say, newtons, ``(n, channels)``.
        self.measured_force = np.zeros((n, self.channels))
        self.measured_position = np.zeros((n, self.motors))  #: what the encoders say, m or rad
        #: What the encoders said when a real gripper was recorded, m or rad, ``(n, motors)``; None if only simulated.
        self.recorded_position: np.ndarray | None = None

    # --- state ---------------------------------------------------------------------------------------------------

    @property
    def velocity(self) -> np.ndarray:
        """Velocities of the motors, m/s or rad/s, ``(n, motors)``; positive opens."""
        return self._qvel[:, self._motor_v] * self._signs

    @property
    def inertia(self) -> np.ndarray:
        """Inertia that each motor moves, all that is coupled to it included, kg or kg·m², ``(n, motors)``."""
        return self.batch.expand("dof_M0") @ self._gearing_squared + self._shared_inertia

    @property
    def rotor_inertia(self) -> np.ndarray:
        """What of it is the motor's own, without what it moves, kg or kg·m², ``(n, motors)``."""
        return self.base("dof_armature") @ self._gearing_squared

    @property
    def motor_force(self) -> np.ndarray:
        """What the motors gave in the last physics step, N or N·m, ``(n, motors)``; 0 before the first one."""
        given = self.batch.bind("qfrc_actuator")[:, self._motor_v] * self._signs
        return np.where(self._at_start[:, None], 0.0, given)

    @property
    def asked_force(self) -> np.ndarray:
        """What position loops ask of the motors now, before any limit, N or N·m, ``(n, motors)``; positive opens."""
        gain, bias = (self.field(f"actuator_{kind}")[:, self.actuators] for kind in ("gainprm", "biasprm"))
        off = self._ctrl[:, self.actuators] - self._controls(self.joint_position)
        speed = self._command_scale * gain[..., 0] / -bias[..., 1] * self.velocity
        return (gain[..., 0] * off + bias[..., 2] * speed) * self._drive_signs

    @property
    def outside_force(self) -> np.ndarray:
        """What acts on the motors' joints from outside, N or N·m, ``(n, motors)``; positive opens.

        Gravity, springs, a load and what presses against the pads; not friction, nor what else effects push.
        """
        return self.weight + self._to_motors(self.press_n) + self._load[:, None]

    @property
    def weight(self) -> np.ndarray:
        """What gravity and springs of the scene do to the motors' joints, N or N·m, ``(n, motors)``; positive opens."""
        weight = self.batch.bind("qfrc_spring") - self.batch.bind("qfrc_bias")
        return weight[:, self._motor_v] * self._signs

    @property
    def pad_position(self) -> np.ndarray:
        """How far each side's pads stand from where they are when closed, metres, ``(n, 2)``; 0 if they never move."""
        return self.to_sides(self.joint_position)

    @property
    def object_position(self) -> np.ndarray:
        """Object position along the grasp axis from where the scene puts it, metres, ``(n,)``."""
        return self._object_of(self._qpos)

    def clearance(self, rows: np.ndarray) -> np.ndarray:
        """Distance between the object and each of a side's pads, metres, ``(len(rows), 2, pads)``; negative inside it.

        Of pads that no effect shifts; infinite of pads that the other side has more of.
        """
        found = [self.distances(self.field("geom_size")[row], self._qpos[row]) for row in rows]
        return np.array(found).reshape(len(rows), 2, max(map(len, self._pad_geoms)))

    def contact_numbers(self, rows: np.ndarray) -> np.ndarray:
        """How hard objects press back, by their softness alone, ``(len(rows), 7)``; see :mod:`.contact_law`."""
        geom = self.object_geoms[0]
        return contact_numbers(self.field("geom_solref")[rows, geom], self.field("geom_solimp")[rows, geom])

    def contact_factors(self, rows: np.ndarray) -> np.ndarray:
        """How many times the scene's damping and stiffness contacts of objects have, ``(len(rows), 2)``."""
        geom = self.object_geoms[:1]
        scene = contact_numbers(self.model.geom_solref[geom], self.model.geom_solimp[geom])[:, :2]
        own = self.contact_numbers(rows)[:, :2]
        return np.divide(own, scene, out=np.ones_like(own), where=scene > 0)

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

    def mass_between(self, rows: np.ndarray) -> np.ndarray:
        """Mass that the distance between each side's pads and the object has, kg, ``(len(rows), 2)``.

        That of both, one against the other, where a motor that moves both sides is held by both; the object's alone on
        a side that stands still.
        """
        work, thing = self.travel**2, self.batch.expand("dof_M0")[rows, self.object_dof, None]
        shared = np.array([work[self._mover == mover].sum() for mover in self._mover]) * (work > 0)
        return 1 / (shared / self.inertia[rows][:, self._mover] + 1 / thing)

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
        self.restore_fields(ids)
        self._forget_friction()
        if self.effects.change_commands:  # what they make of a command is the drive's own, and has no such limit
            self.field("actuator_ctrlrange")[ids[:, None], self.actuators] = (-mujoco.mjMAXVAL, mujoco.mjMAXVAL)
        self.effects.change_model(self, ids)
        self.derive_fields(ids)
        keyframe = {"keyframe": 0} if self.model.nkey else {}
        self.batch.reset(ids, stage=mujoco.mjtStage.mjSTAGE_NONE.value, **keyframe)
        if position is not None:
            self._place(ids, position)
            if self.gripper.command == "position":  # servos hold them there, with no effort
                self._ctrl[ids[:, None], self.actuators] = self._controls(position)
        if velocity is not None:
            self._qvel[ids[:, None], self.motor_dofs] = velocity * self._signs
        if not self.gripper.is_servo:
            self._qpos[ids, self._object_qpos] = self._object_origin + offset_m
        if self._force_range is not None:
            self._force_range[ids] = self.field("actuator_forcerange")[ids][:, self.actuators]
        self._enabled[ids] = self._at_start[ids] = True
        self.batch.forward(ids)
        self.position = self.joint_position = self._motors_of(self._qpos)
        self.pad_shift_m[ids] = self._contact_shift_m[ids] = 0
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
            self._qpos[ids, address] = np.interp(position[:, self.mover_of(dof)], law.position, law.qpos[:, address])
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
            self.batch.step(self._running, steps)
            self._read()
            return
        fresh = fresh if isinstance(fresh, np.ndarray) else np.full(self.n, fresh)
        stale = np.zeros(self.n, bool) if steps > 1 else fresh
        for _ in range(steps):
            self._send(self._after_effects(self.effects.command, command, fresh))
            self._apply_actions()
            self.batch.step(self._running, 1)
            self._at_start[:] = False
            self._read()
            fresh = stale

    def recall(self, commands: np.ndarray, fresh: np.ndarray, positions: np.ndarray, rows: np.ndarray) -> None:
        """Lets effects see what was before the start, so that they remember it; the motors stay where they are.

        Args:
          commands: commanded positions or efforts in each physics step until the start, ``(m, steps, motors)``.
          fresh: which of them were new ones, ``(m, steps)``.
          positions: of the motors, m or rad, ``(m, steps, motors)``.
          rows: which of these each row had before, ``(n,)``.
        """
        now = self.position
        for step in range(commands.shape[1] if self.effects.remember else 0):
            self.position = positions[rows, step]
            if step == 0:
                self.effects.forget()
            self.effects.recall(np.clip(commands[rows, step], *self._command_range), fresh[rows, step])
        self.position = now

    def disturb(self, load: np.ndarray, enabled: np.ndarray) -> None:
        """Says what acts on the motors from outside until the next call.

        Args:
          load: force or torque on each motor, N or N·m, ``(n,)``; positive opens.
          enabled: whether the motors are switched on, ``(n,)``.
        """
        self._load = load
        self._applied[:, self._motor_v] = load[:, None] * self._signs
        self._enabled = np.array(enabled, bool)
        self._write_force_range()

    def stretch_steps(self, times: np.ndarray) -> None:
        """Makes physics steps so many times as long as :attr:`dt`, ``(n,)``, until the next call.

        For samples that are unevenly apart. Effects take steps for as long as they always are.
        """
        self.field("opt.timestep")[:] = self.dt * times

    def run_only(self, ids: np.ndarray) -> None:
        """Lets the other rows than these, ascending, stand as they are from now on."""
        self._running = ids

    def play(
        self,
        commands: np.ndarray,
        fresh: np.ndarray,
        stretch: np.ndarray | None = None,
        at_once: int = 1,
        needed: np.ndarray | None = None,
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Holds each command for one physics step, as :meth:`advance` does, in one call of the engine.

        Afterwards only a reset makes sense: what is read is not brought up to date.

        Args:
          commands: commanded positions, m or rad, ``(n, steps, motors)``.
          fresh: which of them are new ones, ``(n, steps)``.
          stretch: how many times as long as :attr:`dt` steps are, ``(steps ÷ at_once, n)``; as long by default.
          at_once: number of steps that are equally long.
          needed: how many of the steps each row is to make, ``(n,)``, or a few more; after those it stands still. All
            by default.

        Returns:
          Positions ``(n, steps, motors)``, force readings ``(n, steps, channels)`` and object positions ``(n, steps)``
          after each step.

        Raises:
          RuntimeError: if there are effects that act in every step; see :attr:`acts_in_steps`.
        """
        if self.acts_in_steps:
            raise RuntimeError("effects act in every step: advance step by step")
        control = np.repeat(self._ctrl[:, None], commands.shape[1], axis=1)
        commands = self._after_effects(self.effects.commands, commands, fresh)
        control[..., self._drives] = self._controls(commands)
        self._apply_actions()
        steps, scale = commands.shape[1], self.force_scale[:, None, None]
        position, force = (np.empty((self.n, steps, width)) for width in (self.motors, self.channels))
        objects = np.empty((self.n, steps))
        length = max(1, _NUMBERS_AT_ONCE // max(1, self._sensors.size)) if stretch is None else at_once
        needed = np.full(self.n, steps) if needed is None else needed
        for low in range(0, steps, length):
            part = slice(low, min(low + length, steps))
            if stretch is not None:
                self.stretch_steps(stretch[low // length])
            running, stand = np.flatnonzero(needed > low), needed <= low
            for held in (position, force, objects):
                held[stand, part] = held[stand, low - 1][:, None]
            if not len(running):
                continue
            rows = places(running)
            made = self.batch.rollout(part.stop - low, control[rows, part], record=["qpos", "sensordata"], ids=running)
            qpos, sensors = made["qpos"], made["sensordata"]
            position[rows, part], objects[rows, part] = self._motors_of(qpos), self._object_of(qpos)
            force[rows, part] = self._channels_of(sensors, self._pads_of(sensors) * scale[rows], scale[rows])
        return position, force, objects

    @property
    def acts_in_steps(self) -> bool:
        """Whether an effect acts by what happens in a step; see :class:`~.attached_effects.AttachedEffects`."""
        return self.effects.act_in_steps

    def warnings(self) -> np.ndarray:
        """MuJoCo's warning counters, ``(n, kinds)``; all 0 in a sound simulation."""
        return self.batch.warning[..., 1]

    def _send(self, command: np.ndarray) -> None:
        self._ctrl[:, self._drives] = self._controls(command)

    def _after_effects(
        self, effects: Callable[[np.ndarray, np.ndarray], np.ndarray], command: np.ndarray, fresh: np.ndarray
    ) -> np.ndarray:
        """What effects make of commands, which drives take within their range: before all that happens to them."""
        if not self.effects.change_commands:
            return command
        return effects(np.clip(command, *self._command_range), fresh)

    def _controls(self, command: np.ndarray) -> np.ndarray:
        """Control signals of the actuators for commands of the motors, ``(..., motors)``."""
        return command * self._command_scale + self._command_zero

    def _write_force_range(self) -> None:
        """Limits the motors as effects say, and holds still those that are switched off."""
        ranges = self.field("actuator_forcerange")
        if self._force_range is None:
            self._force_range = ranges[:, self.actuators].copy()
        low, high = self._force_range[..., 0], self._force_range[..., 1]
        if self.effects.limit_motors:
            low, high = self._along_the_drives(*self.effects.motor_range(*self._along_the_drives(low, high)))
        enabled = self._enabled[:, None]
        ranges[:, self.actuators, 0], ranges[:, self.actuators, 1] = (
            np.where(enabled, low, 0),
            np.where(enabled, high, 0),
        )

    def _along_the_drives(self, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """A range of forces that open as one of forces of the actuators, or the other way round, ``(n, motors)``."""
        turned = self._drive_signs < 0  # those whose force closes where it is positive
        return (np.where(turned, -high, low), np.where(turned, -low, high)) if turned.any() else (low, high)

    def _apply_actions(self) -> None:
        if self.effects.limit_motors:
            self._write_force_range()
        if not self._contribute():
            return
        if self._is_given("velocity_change"):
            self._qvel[:, self._motor_v] += self._velocity_change * self._signs
        pushed, self._pushed = self._pushed, not self.effects.given.isdisjoint(_PUSHES)
        if not (self._pushed or pushed):
            return
        on_motors = self._to_motors(self.finger_push_n) + self.motor_push + self._load[:, None]
        self._applied[:, self._motor_v] = on_motors * self._signs
        if not self.gripper.is_servo:
            self._applied[:, self.object_dof] = self.object_push_n

    def _read_anew(self, ids: np.ndarray) -> None:
        """Reads rows that were reset; of the others, readings and the memory of their effects stay as they are."""
        others = np.delete(np.arange(self.n), ids)
        readings = self.measured_position[others], self.measured_force[others]
        with self.effects.kept(others):
            self._read()
        self.measured_position, self.measured_force = self.measured_position.copy(), self.measured_force.copy()
        self.measured_position[others], self.measured_force[others] = readings

    def _read(self) -> None:
        self.joint_position, self.pad_force = self._motors_of(self._qpos), self._pads_of(self._sensors)
        self.position = self.effects.motor_position(self.joint_position)
        scale = self.force_scale[:, None]
        self.press_n = self.effects.interaction(self.pad_force)
        self.force = self.press_n * scale
        self.transduced_force = self._channels_of(self._sensors, self.force, scale)
        self.measured_position, self.measured_force = self.position, self.transduced_force
        if len(self.effects.readings):
            self.measured_position, self.measured_force = self.position.copy(), self.transduced_force.copy()
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
        elif name == MASS:
            plant.write_mass(ids, value)
        elif name not in ("offset_m", START_VELOCITY, *OF_READINGS):
            given = plant.gripper.settings.get(name)
            plant.write(plant.gripper.parameters[name].writes if given is None else given, ids, value)
    return values.get("offset_m", np.zeros(len(ids)))
