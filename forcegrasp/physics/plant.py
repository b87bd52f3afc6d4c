"""Many grasps of one gripper on MuJoCo's batch engine, one physics step at a time, with effects where they act."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import mujoco
import numpy as np
from mujoco.batch import Batch

from forcegrasp.physics import guard
from forcegrasp.physics.gripper import BaseParameter, Gripper

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

    Raises:
      ConfigError: if there is no such tier.
    """

    def __init__(self, gripper: Gripper, n: int, tier: str = "reference", threads: int = 0) -> None:
        guard.silence_log()
        self.gripper, self.n = gripper, n
        self.model = model = gripper.compile(tier)
        self.dt = float(model.opt.timestep)  #: physics step, seconds
        self.batch = batch = Batch(model, n, threads)
        self._qpos, self._qvel = batch.bind("qpos"), batch.bind("qvel")
        self._ctrl, self._sensors = batch.bind("ctrl"), batch.bind("sensordata")
        joints = [model.joint(name) for name in gripper.joints]
        self._finger_qpos = [joint.qposadr[0] for joint in joints]
        #: degrees of freedom of the fingers (left, right) and of the object along the grasp axis
        self.finger_dofs = [joint.dofadr[0] for joint in joints]
        thing = model.joint(gripper.object_joint)
        is_free = thing.type[0] == mujoco.mjtJoint.mjJNT_FREE
        self._object_qpos = thing.qposadr[0] + (gripper.axis if is_free else 0)
        self.object_dof = thing.dofadr[0] + (gripper.axis if is_free else 0)
        self.actuators = [model.actuator(name).id for name in gripper.actuators]
        self._object_body = model.geom(gripper.object_geom).bodyid[0]
        #: geoms of the object
        self.object_geoms = np.flatnonzero(model.geom_bodyid == self._object_body)
        self._readings = [slice(s.adr[0], s.adr[0] + s.dim[0]) for s in map(model.sensor, gripper.force_sensors)]
        self._sign = 1.0 if gripper.open > gripper.closed else -1.0
        self._origin = gripper.closed
        self._fields: dict[str, np.ndarray] = {}
        self._effects: list[Effect] = []
        self._hooked: dict[str, list[Effect]] = {}
        self.force_scale = np.ones(n)  #: f_α, factor from the force sensors to the reading, ``(n,)``
        #: What effects add to in each step: friction on the fingers, displacement of the pads towards opening, forces
        #: on the fingers (positive opens) and on the object; ``(n, 2)`` and ``(n,)``.
        self.friction_n, self.pad_shift_m, self.finger_push_n = (np.zeros((n, 2)) for _ in range(3))
        self.object_push_n = np.zeros(n)
        self.measured_force = np.zeros((n, 2))  #: what the force sensors say, newtons
        self.measured_position = np.zeros((n, 2))  #: what the encoders say, metres

    # --- state ---------------------------------------------------------------------------------------------------

    @property
    def position(self) -> np.ndarray:
        """Finger positions (left, right), metres, ``(n, 2)``; 0 is closed."""
        return (self._qpos[:, self._finger_qpos] - self._origin) * self._sign

    @property
    def velocity(self) -> np.ndarray:
        """Finger velocities, m/s, ``(n, 2)``; positive opens."""
        return self._qvel[:, self.finger_dofs] * self._sign

    @property
    def object_position(self) -> np.ndarray:
        """Object position along the grasp axis, metres, ``(n,)``."""
        return self._qpos[:, self._object_qpos].copy()

    @property
    def pad_force(self) -> np.ndarray:
        """Sum of each finger's force sensor at the last physics step, before f_α, newtons, ``(n, 2)``."""
        # contiguous, lest the order of the sum depend on n
        return np.stack([np.ascontiguousarray(self._sensors[:, part]).sum(axis=-1) for part in self._readings], axis=1)

    @property
    def force(self) -> np.ndarray:
        """True fingertip forces (left, right): the interaction with the object times f_α, newtons, ``(n, 2)``."""
        force = self.pad_force
        for effect in self._hooked.get("interaction", ()):
            force[effect.rows] = effect.interaction(force[effect.rows])
        return force * self.force_scale[:, None]

    # --- parameters ----------------------------------------------------------------------------------------------

    def field(self, name: str) -> np.ndarray:
        """A per-simulation field of MuJoCo's model, writable, ``(n, ...)``."""
        if name not in self._fields:
            self._fields[name] = self.batch.expand(name)
        return self._fields[name]

    def write(self, parameter: BaseParameter, ids: np.ndarray, values: np.ndarray) -> None:
        """Writes a base parameter of these rows into the fields that follow it. ``values``: ``(len(ids),)``."""
        rows = {"actuator": self.actuators, "dof": self.finger_dofs, "geom": self.object_geoms}
        for write in parameter.writes:
            field = self.field(write.field)
            for row in rows[write.field.split("_")[0]]:
                if write.column is None:
                    field[ids, row] = write.sign * values
                else:
                    field[ids, row, write.column] = write.sign * values

    def write_radius(self, ids: np.ndarray, radius_m: np.ndarray) -> None:
        """Gives objects a radius (half the width of a box), with the inertia that follows from it at the same mass.

        Bounding boxes, radii and inverse weights follow from these: :meth:`reset` has MuJoCo do it.
        """
        model, body = self.model, self._object_body
        mass, inertia, size = model.body_mass[body], self.field("body_inertia"), self.field("geom_size")
        geom = model.geom(self.gripper.object_geom)
        kind = geom.type[0]
        types = mujoco.mjtGeom
        for index in self.object_geoms:
            size[ids, index, self.gripper.axis if kind == types.mjGEOM_BOX else 0] = radius_m
        # The order of operations is the compiler's: the last bit of an inertia can move a contact point.
        if kind == types.mjGEOM_CYLINDER:
            length = 2 * geom.size[1]
            inertia[ids, body, 0] = mass * (3 * radius_m * radius_m + length * length) / 12
            inertia[ids, body, 1] = inertia[ids, body, 0]
            inertia[ids, body, 2] = mass * radius_m * radius_m / 2
        elif kind == types.mjGEOM_SPHERE:
            inertia[ids, body] = (2 * mass * radius_m * radius_m / 5)[:, None]
        elif kind == types.mjGEOM_BOX:
            half = np.broadcast_to(geom.size, (len(ids), 3)).copy()
            half[:, self.gripper.axis] = radius_m
            squares = half**2
            inertia[ids, body] = mass / 3 * (squares.sum(axis=1, keepdims=True) - squares)

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
        for effect in self._effects:
            which = np.flatnonzero(np.isin(effect.rows, ids))
            effect.reset(which)
            if "change_model" in effect.hooks():
                effect.change_model(self, which)
        self.batch.set_const(ids)
        keyframe = {"keyframe": 0} if self.model.nkey else {}
        self.batch.reset(ids, stage=mujoco.mjtStage.mjSTAGE_NONE.value, **keyframe)
        self._qpos[ids, self._object_qpos] = offset_m
        if position_m is not None:
            self._qpos[np.asarray(ids)[:, None], self._finger_qpos] = position_m * self._sign + self._origin
        self.batch.forward(ids)
        self._read()

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

    def warnings(self) -> np.ndarray:
        """MuJoCo's warning counters, ``(n, kinds)``; all 0 in a sound simulation."""
        return self.batch.warning[..., 1]

    def _send(self, command_m: np.ndarray) -> None:
        self._ctrl[:, self.actuators] = command_m * self._sign + self._origin

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
        push[:, self.finger_dofs] = self.finger_push_n * self._sign
        push[:, self.object_dof] = self.object_push_n

    def _write_friction(self) -> None:
        if not self.friction_n.any() and "dof_frictionloss" not in self._fields:
            return
        loss, model = self.field("dof_frictionloss"), self.model
        for side, dof in enumerate(self.finger_dofs):
            loss[:, dof] = model.dof_frictionloss[dof] + self.friction_n[:, side]
            self.stiffen_friction(dof)

    def stiffen_friction(self, dof: int, rows: np.ndarray | slice = slice(None)) -> None:
        """Lets dry friction on a degree of freedom hold instead of creep, as far as the step allows."""
        self.field("dof_solref")[rows, dof] = _STIFF_SOLREF
        self.field("dof_solimp")[rows, dof] = _STIFF_SOLIMP

    def _write_pad_shift(self) -> None:
        if not self.pad_shift_m.any() and "geom_pos" not in self._fields:
            return
        position, model = self.field("geom_pos"), self.model
        for side, name in enumerate(self.gripper.joints):
            joint = model.joint(name)
            axis = self._sign * joint.axis
            for geom in np.flatnonzero(model.geom_bodyid == joint.bodyid[0]):
                position[:, geom] = model.geom_pos[geom] + self.pad_shift_m[:, side : side + 1] * axis

    def _read(self) -> None:
        self.measured_force, self.measured_position = self.force, self.position
        for hook, reading in (("read_force", self.measured_force), ("read_position", self.measured_position)):
            for effect in self._hooked.get(hook, ()):
                reading[effect.rows] = getattr(effect, hook)(reading[effect.rows])


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
