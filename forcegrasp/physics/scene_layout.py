"""Where motors, pads, forces and the object stand in the arrays of a gripper's compiled scene."""

from __future__ import annotations

import copy
import functools
from dataclasses import dataclass

import mujoco
import numpy as np

from forcegrasp.physics.gripper import Gripper, effort_sensor, own_sensor
from forcegrasp.physics.gripper_parts import Finger
from forcegrasp.physics.opening import command_law, ground_geoms, least_distance, pad_geoms
from forcegrasp.physics.places import places


class SceneLayout:
    """A gripper's places in its scene, and what arrays of the engine mean for its motors, sides and force channels.

    Args:
      gripper: whose scene it is.
      model: the scene, compiled.
    """

    def __init__(self, gripper: Gripper, model: mujoco.MjModel) -> None:
        self.gripper, self.model = gripper, model
        self.motors, self.channels = len(gripper.motors), len(gripper.forces)  #: how many there are
        joints = [model.joint(motor.joint) for motor in gripper.motors]
        #: degrees of freedom of the motors (left, right, or the one), and of the object along the grasp axis
        self.motor_dofs = [joint.dofadr[0] for joint in joints]
        self._find_object(gripper, model)
        self.actuators = [model.actuator(motor.actuator).id for motor in gripper.motors]
        # where motors stand in the engine's arrays: slices, for they are read and written in every step
        self._motor_qpos = [int(joint.qposadr[0]) for joint in joints]
        self._motor_q = places(self._motor_qpos)
        self._motor_v, self._drives = places(self.motor_dofs), places(self.actuators)
        self._pads = [_Pads.find(model, finger.body) for finger in gripper.fingers]
        self._signs = np.array([motor.sign for motor in gripper.motors])
        self._origins = np.array([motor.closed for motor in gripper.motors])
        self._command_scale, self._command_zero = np.ones(self.motors), np.zeros(self.motors)
        #: 1 for a motor whose actuator opens with a positive force, else −1
        self._drive_signs = np.array([m.sign * np.sign(model.actuator(m.actuator).gear[0]) for m in gripper.motors])
        if gripper.command == "position":
            self._command_scale, self._command_zero = command_law(gripper.motors, model)
            self._drive_signs = np.sign(self._command_scale)
        limited = model.actuator_ctrllimited[self.actuators, None].astype(bool)
        takes = np.where(limited, model.actuator_ctrlrange[self.actuators], (-np.inf, np.inf)).T
        # least and greatest command that the actuators take, in the motors' units, ``(2, motors)``
        self._command_range = np.sort((takes - self._command_zero) / self._command_scale, axis=0)
        movers = [finger.motor for finger in gripper.fingers] or [-1, -1]
        #: Which motor moves each side, and how far its pads go per unit of it; 0 for a side that stands still.
        self._mover = np.array([max(motor, 0) for motor in movers])
        self.travel = np.where([motor >= 0 for motor in movers], gripper.opening.travel, 0.0)
        self._readings = [_reading(model, *pair) for pair in gripper.sides]
        self._efforts = self._effort_readings(model)
        self._felt = [i for i, finger in enumerate(gripper.fingers) if finger.force_sensor]

    def _find_object(self, gripper: Gripper, model: mujoco.MjModel) -> None:
        """Where the object stands in the engine's arrays, if there is one."""
        #: geoms of the object
        self.object_geoms = np.empty(0, int)
        #: geoms that it may stand on
        self.ground_geoms = np.empty(0, int)
        #: degrees of freedom of everything but the object
        self.gripper_dofs = list(range(model.nv))
        if gripper.is_servo:
            return
        joint = model.joint(gripper.object_joint)
        is_free = joint.type[0] == mujoco.mjtJoint.mjJNT_FREE
        self._object_qpos = joint.qposadr[0] + (gripper.axis if is_free else 0)
        self._object_origin = model.qpos0[self._object_qpos]  # the middle of the grasp is where the scene puts it
        self.object_dof = joint.dofadr[0] + (gripper.axis if is_free else 0)
        self.gripper_dofs = [i for i in range(model.nv) if model.dof_jntid[i] != joint.id]
        self._object_body = model.geom(gripper.object_geom).bodyid[0]
        self.object_geoms = np.flatnonzero(model.geom_bodyid == self._object_body)
        self.ground_geoms = ground_geoms(model, gripper.object_geom)

    def _object_of(self, qpos: np.ndarray) -> np.ndarray:
        """Object positions along the grasp axis from where the scene puts it, metres, ``(...)``; 0 without one."""
        if self.gripper.is_servo:
            return np.zeros(qpos.shape[:-1])
        return qpos[..., self._object_qpos] - self._object_origin

    def _effort_readings(self, model: mujoco.MjModel) -> tuple[list[int], np.ndarray]:
        """Where the motors' efforts are read, and the fingertip newtons of each, pressing positive, per unit of it."""
        if self.gripper.force != "motor":
            return [], np.empty(0)
        addresses = [model.sensor(effort_sensor(motor)).adr[0] for motor in self.gripper.motors]
        factors = np.empty(self.motors)
        for index, motor in enumerate(self.gripper.motors):
            drive = model.actuator(motor.actuator)
            if self.gripper.is_servo:
                factors[index] = motor.sign
                continue
            length_per_position = self._command_scale[index] * drive.gainprm[0] / -drive.biasprm[1]
            factors[index] = -length_per_position / self.travel[self._moved_by(index)].sum()
        return addresses, factors

    @functools.cached_property
    def pad_geoms(self) -> np.ndarray:
        """Geoms of both sides that touch the object."""
        return np.concatenate(self._pad_geoms)

    @functools.cached_property
    def _pad_geoms(self) -> list[np.ndarray]:
        return [pad_geoms(self.model, finger.body) for finger in self.gripper.fingers]

    def distances(self, sizes: np.ndarray, qpos: np.ndarray) -> np.ndarray:
        """Distance between the object and each side's pads, metres, ``(2, pads)``; negative inside it.

        Infinite of pads that the other side has more of.

        Args:
          sizes: of all geoms, ``(ngeom, 3)``.
          qpos: how the scene stands, ``(nq,)``.
        """
        model, data = self._at_rest
        model.geom_size[:], data.qpos[:] = sizes, qpos
        mujoco.mj_kinematics(model, data)
        solid = [int(g) for g in self.object_geoms if model.geom_contype[g] or model.geom_conaffinity[g]]
        found = np.full((2, max(map(len, self._pad_geoms))), np.inf)
        for side, pads in enumerate(self._pad_geoms):
            found[side, : len(pads)] = [least_distance(model, data, [pad], solid) for pad in pads]
        return found

    @functools.cached_property
    def _at_rest(self) -> tuple[mujoco.MjModel, mujoco.MjData]:
        """A copy of the scene, in which distances are measured."""
        return (model := copy.copy(self.model)), mujoco.MjData(model)

    def _moved_by(self, motor: int) -> np.ndarray:
        return (self._mover == motor) & (self.travel != 0)

    def to_sides(self, of_motors: np.ndarray) -> np.ndarray:
        """Displacements of motors ``(..., motors)`` as displacements of the pads they move, metres, ``(..., 2)``."""
        return of_motors if self.gripper.is_direct else of_motors[..., self._mover] * self.travel

    def _to_motors(self, push_n: np.ndarray) -> np.ndarray:
        """Forces on the pads as what they do to the motors that move them, N or N·m, ``(n, motors)``."""
        if self.gripper.is_direct:
            return push_n
        work, sums = push_n * self.travel, np.zeros((len(push_n), self.motors))
        for motor, sides in enumerate(self._sides):
            for side in sides:
                sums[:, motor] += work[:, side]
        return sums

    @functools.cached_property
    def _sides(self) -> list[list[int]]:
        """Which sides each motor moves."""
        return [np.flatnonzero(self._moved_by(motor)).tolist() for motor in range(self.motors)]

    @functools.cached_property
    def gearing(self) -> np.ndarray:
        """How far each joint goes per unit of each motor, on average, ``(motors, degrees of freedom)``."""
        found, law = np.zeros((self.motors, self.model.nv)), self.gripper.opening
        found[np.arange(self.motors), self.motor_dofs] = 1
        for dof in self.gripper_dofs if law.qpos.size else ():
            way = law.qpos[[0, -1], self.model.jnt_qposadr[self.model.dof_jntid[dof]]]
            found[self.mover_of(dof), dof] = np.diff(way)[0] / (law.position[-1] - law.position[0])
        return found

    @functools.cached_property
    def _gearing_squared(self) -> np.ndarray:
        """What of a joint's inertia each motor moves, ``(degrees of freedom, motors)``."""
        return (self.gearing**2).T

    @functools.cached_property
    def _shared_inertia(self) -> np.ndarray:
        """What joints on the same bodies add to the inertia that each motor moves, beside their own, ``(motors,)``."""
        data, inertia = mujoco.MjData(self.model), np.zeros((self.model.nv, self.model.nv))
        mujoco.mj_forward(self.model, data)
        mujoco.mj_fullM(self.model, data, inertia)
        np.fill_diagonal(inertia, 0.0)
        return np.einsum("mi,ij,mj->m", self.gearing, inertia, self.gearing)

    def mover_of(self, dof: int) -> int:
        """Index of the motor that moves a joint of the gripper."""
        return int(self._mover[1] if dof in self._dofs_of_right else self._mover[0])

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

    def _motors_of(self, qpos: np.ndarray) -> np.ndarray:
        angles = qpos[..., self._motor_q]
        return angles.copy() if self._are_positions else (angles - self._origins) * self._signs

    @functools.cached_property
    def _are_positions(self) -> bool:
        """Whether the engine's numbers for the motors' joints are the motors' positions."""
        return bool((self._origins == 0).all() and (self._signs == 1).all())

    def _channels_of(self, sensors: np.ndarray, force: np.ndarray, scale: np.ndarray) -> np.ndarray:
        """What the force channels transduce, newtons, ``(..., channels)``: forces of fingers, or efforts of motors."""
        addresses, factors = self._efforts
        if addresses:
            return sensors[..., addresses] * factors * scale
        return force if len(self._felt) == 2 else force[..., self._felt]

    def _pads_of(self, sensors: np.ndarray) -> np.ndarray:
        # contiguous, lest the order of the sum depend on n
        if not self._readings:
            return np.zeros((*sensors.shape[:-1], 2))
        if self._readings_alike is not None:
            felt = np.ascontiguousarray(sensors[..., self._readings_alike])
            return felt.reshape(*sensors.shape[:-1], len(self._readings), -1).sum(axis=-1)
        sums = np.empty((*sensors.shape[:-1], len(self._readings)))
        for side, part in enumerate(self._readings):
            np.ascontiguousarray(sensors[..., part]).sum(axis=-1, out=sums[..., side])
        return sums

    @functools.cached_property
    def _readings_alike(self) -> slice | np.ndarray | None:
        """Where the numbers of all sides stand, one side after the other; None if some have more of them."""
        each = [range(part.stop)[part] for part in self._readings]
        return places(np.concatenate(each)) if len({len(one) for one in each}) == 1 else None


@dataclass(frozen=True)
class _Pads:
    """What moves with a side's pads, in the frame of their body."""

    body: int
    #: field of positions → indices, and where the scene puts them
    moved: dict[str, tuple[slice | np.ndarray, np.ndarray]]

    @classmethod
    def find(cls, model: mujoco.MjModel, name: str) -> _Pads:
        body = int(model.body(name).id)
        owners = {"geom_pos": model.geom_bodyid, "site_pos": model.site_bodyid, "body_pos": model.body_parentid}
        inside = {field: np.flatnonzero(of == body) for field, of in owners.items()}
        return cls(
            body, {field: (places(own), getattr(model, field)[own]) for field, own in inside.items() if len(own)}
        )


def _reading(model: mujoco.MjModel, side: str, finger: Finger) -> slice:
    """Where the numbers stand whose sum is a side's force; of sensors that were added, the normal forces alone."""
    sensor = model.sensor(finger.force_sensor or own_sensor(side))
    return slice(sensor.adr[0], sensor.adr[0] + sensor.dim[0], 1 if finger.force_sensor else 3)
