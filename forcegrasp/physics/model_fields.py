"""A scene compiled for many grasps, each with its own values of the model's fields."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np
from mujoco.batch import Batch

from forcegrasp.cores import usable_cores
from forcegrasp.physics import guard
from forcegrasp.physics.fast import SPHERE
from forcegrasp.physics.gripper import Gripper
from forcegrasp.physics.gripper_parts import FieldWrite
from forcegrasp.physics.inertia import inertia_of_radius
from forcegrasp.physics.scene_layout import SceneLayout

# Constraint that holds a finger against dry friction: as stiff as the engine and the step allow, lest it creeps under
# load. In place of a time constant below two steps MuJoCo takes two steps, and no impedance is larger.
_STIFF_SOLREF = (1e-4, 1.0)
_STIFF_SOLIMP = (0.9999, 0.9999, 0.001, 0.5, 2.0)


class ModelFields(SceneLayout):
    """Base parameters are written into per-simulation fields of MuJoCo's model, and effects change these.

    Nothing is recompiled for it.

    Args:
      gripper: what is simulated.
      n: number of grasps.
      tier: physics tier, see :meth:`~forcegrasp.physics.gripper.Gripper.compile`.
      threads: threads of the engine; 0 uses every core that this process may use.
      step_factor: multiplies the physics step.
      other_collisions: uses MuJoCo's other collision code, native for libccd or libccd for native.

    Raises:
      ConfigError: if there is no such tier.
    """

    def __init__(
        self, gripper: Gripper, n: int, tier: str, threads: int, step_factor: float, other_collisions: bool
    ) -> None:
        guard.silence_log()
        guard.stop_clock()
        self.n, self._tier = n, tier
        model = gripper.compile(tier)
        model.opt.timestep *= step_factor
        if other_collisions:
            model.opt.disableflags ^= mujoco.mjtDisableBit.mjDSBL_NATIVECCD
        self.dt = float(model.opt.timestep)  #: physics step, seconds
        super().__init__(gripper, model)
        self._prepare(model)
        self.batch = Batch(model, n, threads or usable_cores())
        self._fields: dict[str, np.ndarray] = {}
        self._base: dict[str, np.ndarray] = {}

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

    def write(self, writes: Sequence[FieldWrite], ids: np.ndarray, values: np.ndarray) -> None:
        """Writes a number of these rows into the fields that follow it. ``values``: ``(len(ids),)``."""
        joints = [motor.joint for motor in self.gripper.motors]
        bodies = self.model.dof_bodyid[self.motor_dofs]  # that the motors move
        rows = {"actuator": self.actuators, "body": bodies, "dof": self.gripper_dofs, "geom": self.object_geoms}
        of_motors = rows | {"dof": self.motor_dofs}
        for write in writes:
            kind = write.field.split("_")[0]
            for row in [of_motors[kind][joints.index(write.joint)]] if write.joint else rows[kind]:
                column = () if write.column is None else (write.column,)
                more = self._more_damping[row] if write.field == "dof_damping" else 0.0
                self._write_base(write.field, (ids, row, *column), write.sign * values + more)

    @functools.cached_property
    def _more_damping(self) -> np.ndarray:
        """What the tier adds to the scene's damping, and so to any that is written, ``(degrees of freedom,)``."""
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

    def write_mass(self, ids: np.ndarray, mass_kg: np.ndarray) -> None:
        """Gives objects a mass, kg, ``(len(ids),)``, spread over them as in the scene; NaN leaves them as they are."""
        given, body = np.isfinite(mass_kg), self._object_body
        ids, mass_kg = ids[given], mass_kg[given]
        times = mass_kg / self.base("body_mass")[ids, body]
        self._write_base("body_inertia", (ids, body), times[:, None] * self.base("body_inertia")[ids, body])
        self._write_base("body_mass", (ids, body), mass_kg)

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
            if "body_mass" in self._base:  # they may have masses of their own
                inertia *= self._base["body_mass"][ids, self._object_body, None] / model.body_mass[self._object_body]
            fields.append(("body_inertia", (ids, self._object_body), inertia))
        return fields

    def stiffen_friction(self, dof: int, rows: np.ndarray | slice = slice(None)) -> None:
        """Lets dry friction that an effect added hold instead of creep, as far as the step allows."""
        more = (self.field("dof_frictionloss") > self.base("dof_frictionloss"))[rows, dof, None]
        for name, stiff in (("dof_solref", _STIFF_SOLREF), ("dof_solimp", _STIFF_SOLIMP)):
            self.field(name)[rows, dof] = np.where(more, stiff, self.base(name)[rows, dof])

    def let_friction_creep(self, dof: int, rows: np.ndarray, speed: np.ndarray) -> None:
        """Lets dry friction that an effect added grow in proportion to the speed until it slides.

        The engine makes a friction's constraint as a damper with a mass of its own, as small as the step allows.

        Args:
          dof: of the object, one in which it slides.
          rows: whose friction it is.
          speed: at which it slides, m/s, ``(len(rows),)``; where it is 0 friction holds at rest.
        """
        self.stiffen_friction(dof, rows)
        loss = self.field("dof_frictionloss")[rows, dof]
        creeps = (speed > 0) & (loss > self.base("dof_frictionloss")[rows, dof])
        rows, damping = rows[creeps], loss[creeps] / speed[creeps]
        mass = self.field("body_mass")[rows, self.model.dof_bodyid[dof]]
        # the force is −(a + b v) d / (1 − d) m, held to the friction: a damper if b d m / (1 − d) is its damping
        rate = 0.5 * np.minimum(1 / self.dt, damping / mass)  # b d, which the steps must resolve
        impedance = 1 - rate * mass / damping
        self.field("dof_solref")[rows, dof] = np.stack([-np.ones_like(rate), -rate], axis=1)
        self.field("dof_solimp")[rows, dof, :2] = impedance[:, None]

    def restore_fields(self, ids: np.ndarray) -> None:
        """Takes back in these rows whatever effects made of the fields."""
        for name, field in self._fields.items():
            field[ids] = self._base[name][ids]

    def derive_fields(self, ids: np.ndarray) -> None:
        """Has MuJoCo compute in these rows what follows from the fields."""
        self.batch.set_const(ids)
        for name, index, frame in self._pad_frames:  # set_const finds them anew
            self.batch.expand(name)[ids, index] = frame
