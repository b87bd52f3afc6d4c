"""Many grasps at once on MuJoCo's batch engine."""

from __future__ import annotations

import mujoco
import numpy as np
from mujoco.batch import Batch

from forcegrasp.physics import guard
from forcegrasp.physics.model import CONTROL_PERIOD_S, build_model
from forcegrasp.physics.parameters import GraspParameters
from forcegrasp.physics.sampling import OPEN_M

_FINGERS = ("finger_l", "finger_r")


class GraspSimulator:
    """Simulates ``n`` grasps of TIAGo's gripper, each with its own parameters, 25 control steps per second.

    Parameters are written into per-simulation model fields at reset: nothing is recompiled. Results do not depend on
    the number of threads, on ``n``, or on what a slot simulated before, to the last bit.

    Args:
      n: number of grasps.
      tier: physics tier, ``"reference"`` or ``"fast"``, see :func:`~forcegrasp.physics.model.build_model`.
      threads: threads of the engine; 0 uses every core.

    Raises:
      ConfigError: if there is no such tier.
    """

    def __init__(self, n: int, tier: str = "reference", threads: int = 0) -> None:
        guard.silence_log()
        self.model = model = build_model(tier)
        self.n = n
        self.steps = np.zeros(n, dtype=np.int64)  #: control steps since the grasp was reset, ``(n,)``
        self.parameters = GraspParameters(*np.broadcast_to(np.array([[0.5], [-9.0], [0.025], [0.0], [0.1]]), (5, n)))
        self.commanded_position = np.full((n, 2), OPEN_M)  #: q_des of the last step, metres, ``(n, 2)``
        self.object_speed = np.zeros(n)  #: |o_y(t) − o_y(t−1)|, metres per control step, ``(n,)``
        self._substeps = round(CONTROL_PERIOD_S / model.opt.timestep)
        self._batch = batch = Batch(model, n, threads)
        self._qpos, self._ctrl, self._sensors = batch.bind("qpos"), batch.bind("ctrl"), batch.bind("sensordata")
        self._fingers = [model.joint(name).qposadr[0] for name in _FINGERS]
        self._object_y = model.joint("object").qposadr[0] + 1
        self._fields = _ObjectFields(batch)
        self._force_scale = np.ones(n)
        self.reset(self.parameters)

    @property
    def joint_position(self) -> np.ndarray:
        """Finger positions (left, right), metres, ``(n, 2)``; 0 is closed, 0.045 open."""
        return self._qpos[:, self._fingers]

    @property
    def object_position(self) -> np.ndarray:
        """Object position along the grasp axis, metres, ``(n,)``."""
        return self._qpos[:, self._object_y].copy()

    @property
    def force(self) -> np.ndarray:
        """Fingertip forces (left, right), newtons, ``(n, 2)``.

        A finger's reading is the sum over its contacts of the normal and both signed tangential components at the last
        physics step, times f_α (authors' code).
        """
        per_finger = self._sensors.reshape(self.n, 2, -1).sum(axis=-1)
        return per_finger * self._force_scale[:, None]

    def reset(self, parameters: GraspParameters, ids: np.ndarray | None = None) -> None:
        """Opens the gripper and puts an object of the given parameters between the fingers.

        Args:
          parameters: one set per grasp that is reset.
          ids: the slots to reset, in ascending order; all of them by default.
        """
        ids = np.arange(self.n) if ids is None else np.asarray(ids)
        if len(parameters) != len(ids):
            raise ValueError(f"got parameters of {len(parameters)} grasps for {len(ids)} slots")
        if len(ids) == 0:
            return
        merged = self.parameters.as_array()
        merged[ids] = parameters.as_array()
        self.parameters = GraspParameters.from_array(merged)
        self._force_scale[ids] = parameters.force_scale
        self._fields.write(ids, parameters)
        self._batch.set_const(ids)
        self._batch.reset(ids, keyframe=0, stage=mujoco.mjtStage.mjSTAGE_NONE.value)
        self._qpos[ids, self._object_y] = parameters.offset_m
        self._batch.forward(ids)
        self.commanded_position[ids] = OPEN_M
        self.object_speed[ids] = 0.0
        self.steps[ids] = 0

    def step(self, joint_delta: np.ndarray) -> None:
        """Commands ``q_des = q + u`` to both fingers and simulates one control step (paper, eq. 4).

        Args:
          joint_delta: u = Δq_des, metres, ``(n, 2)``; negative closes.

        Raises:
          PhysicsError: if a grasp diverged.
        """
        self.command(self.joint_position + joint_delta)

    def command(self, position: np.ndarray) -> None:
        """Holds a commanded position (metres, ``(n, 2)``, clipped to the joint range) for one control step.

        Raises:
          PhysicsError: if a grasp diverged.
        """
        before = self.object_position
        np.clip(position, 0.0, OPEN_M, out=self.commanded_position)
        self._ctrl[:] = self.commanded_position
        self._batch.step(nstep=self._substeps)
        guard.check(self._batch.warning[..., 1], self.parameters, self.steps)
        self.steps += 1
        self.object_speed = np.abs(self.object_position - before)

    def scene(self, grasp: int) -> tuple[mujoco.MjModel, mujoco.MjData]:
        """Model and data of one grasp as it stands, forwarded, to render or inspect."""
        model = self._batch.get_model(grasp)
        data = self._batch.get_data(grasp)
        mujoco.mj_forward(model, data)
        return model, data


class _ObjectFields:
    """Writes a grasp's parameters into the fields that MuJoCo compiled for the nominal object, to the same bits.

    Bounding boxes, radii and inverse weights follow from these: :meth:`Batch.set_const` does it.
    """

    def __init__(self, batch: Batch) -> None:
        model = batch.model
        self._body = model.body("object").id
        self._geoms = np.flatnonzero(model.geom_bodyid == self._body)
        self._mass, self._length = model.body_mass[self._body], 2 * model.geom("object").size[1]
        self._size, self._solimp = batch.expand("geom_size"), batch.expand("geom_solimp")
        self._inertia, self._bias = batch.expand("body_inertia"), batch.expand("actuator_biasprm")

    def write(self, ids: np.ndarray, parameters: GraspParameters) -> None:
        radius, mass, length = parameters.radius_m, self._mass, self._length
        # The order of operations is the compiler's: the last bit of an inertia can move a contact point.
        self._inertia[ids, self._body, 0] = mass * (3 * radius * radius + length * length) / 12
        self._inertia[ids, self._body, 1] = self._inertia[ids, self._body, 0]
        self._inertia[ids, self._body, 2] = mass * radius * radius / 2
        for geom in self._geoms:
            self._size[ids, geom, 0] = radius
            self._solimp[ids, geom, 2] = parameters.rho_m
        self._bias[ids, :, 2] = parameters.b2[:, None]
