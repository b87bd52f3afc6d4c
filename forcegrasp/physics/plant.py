"""Many grasps of one gripper on MuJoCo's batch engine, one physics step at a time, with effects where they act."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np
from mujoco.batch import Batch

from forcegrasp.physics import guard
from forcegrasp.physics.fast import SPHERE
from forcegrasp.physics.gripper import BaseParameter, Gripper
from forcegrasp.physics.inertia import inertia_of_radius

if TYPE_CHECKING:
    from forcegrasp.effects.base import Effect

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
        joints = [model.joint(name) for name in gripper.joints]
        #: degrees of freedom of the fingers (left, right) and of the object along the grasp axis
        self.finger_dofs = [joint.dofadr[0] for joint in joints]
        thing = model.joint(gripper.object_joint)
        is_free = thing.type[0] == mujoco.mjtJoint.mjJNT_FREE
        self._object_qpos = thing.qposadr[0] + (gripper.axis if is_free else 0)
        self._object_origin = model.qpos0[self._object_qpos]  # the middle of the grasp is where the scene puts it
        self.object_dof = thing.dofadr[0] + (gripper.axis if is_free else 0)
        self.actuators = [model.actuator(name).id for name in gripper.actuators]
        # where fingers stand in the engine's arrays: slices, for they are read and written in every step
        self._finger_q = _pair(*(joint.qposadr[0] for joint in joints))
        self._finger_v, self._drives = _pair(*self.finger_dofs), _pair(*self.actuators)
        self._finger_velocity = batch.bind("qvel")[:, self._finger_v]
        self._object_body = model.geom(gripper.object_geom).bodyid[0]
        #: geoms of the object
        self.object_geoms = np.flatnonzero(model.geom_bodyid == self._object_body)
        #: What moves with a finger's pads, in the frame of the finger's body: field of positions → indices.
        self._pads = [
            {
                "geom_pos": np.flatnonzero(model.geom_bodyid == joint.bodyid[0]),
                "site_pos": np.flatnonzero(model.site_bodyid == joint.bodyid[0]),
                "body_pos": np.flatnonzero(model.body_parentid == joint.bodyid[0]),
            }
            for joint in joints
        ]
        self._readings = [slice(s.adr[0], s.adr[0] + s.dim[0]) for s in map(model.sensor, gripper.force_sensors)]
        self._sign = 1.0 if gripper.open > gripper.closed else -1.0
        self._origin = gripper.closed
        self._fields: dict[str, np.ndarray] = {}
        self._base: dict[str, np.ndarray] = {}
        self._rubbing: np.ndarray | None = None  # which fingers' friction was stiffened, ``(n, 2)``
        self._effects: list[Effect] = []
        self._hooked: dict[str, list[Effect]] = {}
        self.force_scale = np.ones(n)  #: f_α, factor from the force sensors to the reading, ``(n,)``
        #: What effects add to in each step: friction on the fingers, displacement of the pads towards opening, forces
        #: on the fingers (positive opens) and on the object; ``(n, 2)`` and ``(n,)``.
        self.friction_n, self.pad_shift_m, self.finger_push_n = (np.zeros((n, 2)) for _ in range(3))
        self.object_push_n = np.zeros(n)
        self.position = np.zeros((n, 2))  #: finger positions (left, right), metres; 0 is closed
        #: Sum of each finger's force sensor at the last physics step, before f_α, newtons, ``(n, 2)``.
        self.pad_force = np.zeros((n, 2))
        #: True fingertip forces (left, right): the interaction with the object times f_α, newtons, ``(n, 2)``.
        self.force = np.zeros((n, 2))
        self.measured_force = np.zeros((n, 2))  #: what the force sensors say, newtons
        self.measured_position = np.zeros((n, 2))  #: what the encoders say, metres
        #: What the encoders said when a real gripper was recorded, metres, ``(n, 2)``; None if only simulated.
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
        bodies = [model.joint(name).bodyid[0] for name in self.gripper.joints]
        #: Pads in the very frame of their body, whose own position would not be read: field, index, what it must be.
        self._pad_frames = [
            (f"{kind}_sameframe", index, only_rotation[same])
            for kind in ("geom", "site")
            for index, (body, same) in enumerate(
                zip(getattr(model, f"{kind}_bodyid"), getattr(model, f"{kind}_sameframe"), strict=True)
            )
            if body in bodies and same in only_rotation
        ]
        for name in self.gripper.actuators:  # without a limit, a range would not be read
            actuator = model.actuator(name).id
            if not model.actuator_forcelimited[actuator]:
                model.actuator_forcelimited[actuator] = 1
                model.actuator_forcerange[actuator] = -np.inf, np.inf

    # --- state ---------------------------------------------------------------------------------------------------

    @property
    def velocity(self) -> np.ndarray:
        """Finger velocities, m/s, ``(n, 2)``; positive opens."""
        return self._finger_velocity * self._sign

    @property
    def object_position(self) -> np.ndarray:
        """Object position along the grasp axis from where the scene puts it, metres, ``(n,)``."""
        return self._qpos[:, self._object_qpos] - self._object_origin

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
        rows = {"actuator": self.actuators, "dof": self.finger_dofs, "geom": self.object_geoms}
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

    def attach(self, effects: Sequence[tuple[Effect, np.ndarray]]) -> None:
        """Puts effects into the plant, each on its own rows, in the order of their stages; replaces earlier ones."""
        self._effects = [effect.attach(self, rows) for effect, rows in sorted(effects, key=lambda pair: pair[0].rank)]
        hooks = ("change_model", "command", "act", "interaction", "read_force", "read_position")
        self._hooked = {hook: [e for e in self._effects if hook in e.hooks()] for hook in hooks}

    def reset(self, ids: np.ndarray, offset_m: np.ndarray, position_m: np.ndarray | None = None) -> None:
        """Starts grasps anew, after their parameters were written.

        Args:
          ids: the rows, ascending.
          offset_m: where their objects stand along the grasp axis, ``(len(ids),)``.
          position_m: where the fingers stand, ``(len(ids), 2)``; as in the scene by default.
        """
        for name, field in self._fields.items():  # whatever effects made of it
            field[ids] = self._base[name][ids]
        self._rubbing = None
        for effect in self._effects:
            which = np.flatnonzero(np.isin(effect.rows, ids))
            effect.reset(which)
            if "change_model" in effect.hooks():
                effect.change_model(self, which)
        self.batch.set_const(ids)
        for name, index, frame in self._pad_frames:  # set_const finds them anew
            self.batch.expand(name)[ids, index] = frame
        keyframe = {"keyframe": 0} if self.model.nkey else {}
        self.batch.reset(ids, stage=mujoco.mjtStage.mjSTAGE_NONE.value, **keyframe)
        self._qpos[ids, self._object_qpos] = self._object_origin + offset_m
        if position_m is not None:
            self._qpos[ids, self._finger_q] = position_m * self._sign + self._origin
        self.batch.forward(ids)
        for effect in self._effects:  # all rows are read, but only these anew
            effect.new_reading[:] = np.isin(effect.rows, ids)[:, None]
        self._read()
        for effect in self._effects:
            effect.new_reading[:] = True

    # --- time ----------------------------------------------------------------------------------------------------

    def advance(self, command_m: np.ndarray, steps: int = 1, fresh: np.ndarray | bool = True) -> None:
        """Holds a command for some physics steps.

        Args:
          command_m: commanded positions, metres, ``(n, 2)``.
          steps: number of physics steps.
          fresh: whether the command is a new one, ``(n,)`` or for all.
        """
        if not self._effects:
            self._send(command_m)
            self.batch.step(nstep=steps)
            self._read()
            return
        fresh = np.broadcast_to(fresh, (self.n,))
        for _ in range(steps):
            self._send(self._through_command(command_m, fresh))
            self._apply_actions()
            self.batch.step(nstep=1)
            self._read()
            fresh = np.zeros(self.n, bool)

    def play(self, commands_m: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Holds each command for one physics step, as :meth:`advance` does, in one call of the engine.

        Afterwards only a reset makes sense: what is read is not brought up to date.

        Args:
          commands_m: commanded positions, metres, ``(n, steps, 2)``.

        Returns:
          Finger positions and forces after each step, ``(n, steps, 2)``, and object positions, ``(n, steps)``.

        Raises:
          RuntimeError: if there are effects that act in every step; see :attr:`acts_in_steps`.
        """
        if self.acts_in_steps:
            raise RuntimeError("effects act in every step: advance step by step")
        control = np.repeat(self._ctrl[:, None], commands_m.shape[1], axis=1)
        control[..., self._drives] = commands_m * self._sign + self._origin
        record = self.batch.rollout(commands_m.shape[1], control, record=["qpos", "sensordata"])
        force = self._pads_of(record["sensordata"]) * self.force_scale[:, None, None]
        return self._fingers_of(record["qpos"]), force, record["qpos"][..., self._object_qpos] - self._object_origin

    @property
    def acts_in_steps(self) -> bool:
        """Whether an effect acts in every step, and not only on the model when a grasp starts."""
        return any(effects for hook, effects in self._hooked.items() if hook != "change_model")

    def warnings(self) -> np.ndarray:
        """MuJoCo's warning counters, ``(n, kinds)``; all 0 in a sound simulation."""
        return self.batch.warning[..., 1]

    def _fingers_of(self, qpos: np.ndarray) -> np.ndarray:
        return (qpos[..., self._finger_q] - self._origin) * self._sign

    def _pads_of(self, sensors: np.ndarray) -> np.ndarray:
        # contiguous, lest the order of the sum depend on n
        sums = [np.ascontiguousarray(sensors[..., part]).sum(axis=-1) for part in self._readings]
        return np.stack(sums, axis=-1)

    def _send(self, command_m: np.ndarray) -> None:
        self._ctrl[:, self._drives] = command_m * self._sign + self._origin

    def _through_command(self, command_m: np.ndarray, fresh: np.ndarray) -> np.ndarray:
        effects = self._hooked["command"]
        if not effects:
            return command_m
        command = np.array(command_m, float)
        for effect in effects:
            command[effect.rows] = effect.command(command[effect.rows], fresh[effect.rows])
        return command

    def _apply_actions(self) -> None:
        effects = self._hooked["act"]
        if not effects:
            return
        for total in (self.friction_n, self.pad_shift_m, self.finger_push_n, self.object_push_n):
            total[:] = 0
        for effect in effects:
            effect.act()
        self._write_friction()
        self._write_pad_shift()
        push = self.batch.bind("qfrc_applied")
        push[:, self._finger_v] = self.finger_push_n * self._sign
        push[:, self.object_dof] = self.object_push_n

    def _write_friction(self) -> None:
        if not self.friction_n.any() and "dof_frictionloss" not in self._fields:
            return
        base = self.base("dof_frictionloss")[:, self._finger_v]
        loss = self.field("dof_frictionloss")[:, self._finger_v] = base + self.friction_n
        rubbing = loss > base
        if self._rubbing is None or not np.array_equal(rubbing, self._rubbing):
            self._rubbing = rubbing
            for dof in self.finger_dofs:
                self.stiffen_friction(dof)

    def stiffen_friction(self, dof: int, rows: np.ndarray | slice = slice(None)) -> None:
        """Lets dry friction that an effect added hold instead of creep, as far as the step allows."""
        more = (self.field("dof_frictionloss") > self.base("dof_frictionloss"))[rows, dof, None]
        for name, stiff in (("dof_solref", _STIFF_SOLREF), ("dof_solimp", _STIFF_SOLIMP)):
            self.field(name)[rows, dof] = np.where(more, stiff, self.base(name)[rows, dof])

    def _write_pad_shift(self) -> None:
        if not self.pad_shift_m.any() and "geom_pos" not in self._fields:
            return
        for side, name in enumerate(self.gripper.joints):
            joint = self.model.joint(name)
            shift = self.pad_shift_m[:, side : side + 1] * (self._sign * joint.axis)
            for field, indices in self._pads[side].items():
                for index in indices:
                    self.field(field)[:, index] = getattr(self.model, field)[index] + shift

    def _read(self) -> None:
        self.position, self.pad_force = self._fingers_of(self._qpos), self._pads_of(self._sensors)
        force = self.pad_force.copy()
        for effect in self._hooked.get("interaction", ()):
            force[effect.rows] = effect.interaction(force[effect.rows])
        self.force = force * self.force_scale[:, None]
        self.measured_force, self.measured_position = self.force.copy(), self.position.copy()
        for hook, reading in (("read_force", self.measured_force), ("read_position", self.measured_position)):
            for effect in self._hooked.get(hook, ()):
                reading[effect.rows] = getattr(effect, hook)(reading[effect.rows])


def _pair(one: int, other: int) -> slice:
    """The slice that holds these two indices, in this order."""
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
