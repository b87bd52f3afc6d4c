"""Many grasps at once, one command at a time: what the learning environment runs on."""

from __future__ import annotations

import dataclasses
from typing import Protocol

import mujoco
import numpy as np

from forcegrasp.physics import guard
from forcegrasp.physics.gripper import load_gripper
from forcegrasp.physics.model import CONTROL_PERIOD_S
from forcegrasp.physics.parameters import GraspParameters
from forcegrasp.physics.plant import Plant, write_base
from forcegrasp.physics.sampling import OPEN_M


class Variation(Protocol):
    """What makes one gripper differ from another."""

    def attach(self, plant: Plant) -> None:
        """Prepares a plant, once."""
        ...

    def draw(self, rng: np.random.Generator, ids: np.ndarray) -> dict[str, np.ndarray]:
        """Draws anew for these rows, before they are reset; returns base parameters, each ``(len(ids),)``."""
        ...


class GraspSimulator:
    """Simulates ``n`` grasps of TIAGo's gripper, each with its own parameters, 25 control steps per second.

    Results do not depend on the number of threads, on ``n``, or on what a slot simulated before, to the last bit.

    Args:
      n: number of grasps.
      tier: physics tier, ``"reference"`` or ``"fast"``, see :meth:`~forcegrasp.physics.gripper.Gripper.compile`.
      threads: threads of the engine; 0 uses every core.
      variation: draws the gripper's own parameters and effects at each reset; nominal and none by default.

    Raises:
      ConfigError: if there is no such tier.
    """

    def __init__(self, n: int, tier: str = "reference", threads: int = 0, variation: Variation | None = None) -> None:
        self.plant = plant = Plant(load_gripper("tiago"), n, tier, threads)
        self.model = plant.model
        self.n = n
        self.steps = np.zeros(n, dtype=np.int64)  #: control steps since the grasp was reset, ``(n,)``
        self.parameters = GraspParameters(*np.broadcast_to(np.array([[0.5], [-9.0], [0.025], [0.0], [0.1]]), (5, n)))
        self.commanded_position = np.full((n, 2), OPEN_M)  #: q_des of the last step, metres, ``(n, 2)``
        self.object_speed = np.zeros(n)  #: ``|o_y(t) − o_y(t−1)|``, metres per control step, ``(n,)``
        self._substeps = round(CONTROL_PERIOD_S / plant.dt)
        self._variation = variation
        if variation is not None:
            variation.attach(plant)
        self.reset(self.parameters)

    @property
    def joint_position(self) -> np.ndarray:
        """Finger positions (left, right), metres, ``(n, 2)``; 0 is closed, 0.045 open."""
        return self.plant.position.copy()

    @property
    def object_position(self) -> np.ndarray:
        """Object position along the grasp axis, metres, ``(n,)``."""
        return self.plant.object_position

    @property
    def force(self) -> np.ndarray:
        """Fingertip forces (left, right), newtons, ``(n, 2)``.

        A finger's reading is the sum over its contacts of the normal and both signed tangential components at the last
        physics step, times f_α (authors' code).
        """
        return self.plant.force.copy()

    @property
    def measured_position(self) -> np.ndarray:
        """What the encoders say, before noise, metres, ``(n, 2)``; the positions themselves if nothing changes them."""
        return self.plant.measured_position

    @property
    def measured_force(self) -> np.ndarray:
        """What the force sensors say, before noise, newtons, ``(n, 2)``; the true ones if nothing changes them."""
        return self.plant.measured_force

    def reset(
        self, parameters: GraspParameters, ids: np.ndarray | None = None, rng: np.random.Generator | None = None
    ) -> None:
        """Opens the gripper and puts an object of the given parameters between the fingers.

        Args:
          parameters: one set per grasp that is reset.
          ids: the slots to reset, in ascending order; all of them by default.
          rng: what the variation draws from; one of its own by default.
        """
        ids = np.arange(self.n) if ids is None else np.asarray(ids)
        if len(parameters) != len(ids):
            raise ValueError(f"got parameters of {len(parameters)} grasps for {len(ids)} slots")
        if len(ids) == 0:
            return
        drawn = {} if self._variation is None else self._variation.draw(rng or np.random.default_rng(0), ids)
        if "velocity_gain" in drawn:
            parameters = dataclasses.replace(parameters, b2=drawn["velocity_gain"])
        merged = self.parameters.as_array()
        merged[ids] = parameters.as_array()
        self.parameters = GraspParameters.from_array(merged)
        base = drawn | {
            "velocity_gain": parameters.b2,
            "rho_m": parameters.rho_m,
            "force_scale": parameters.force_scale,
            "radius_m": parameters.radius_m,
            "offset_m": parameters.offset_m,
        }
        self.plant.reset(ids, write_base(self.plant, ids, base))
        self.commanded_position[ids] = OPEN_M
        self.object_speed[ids] = 0.0
        self.steps[ids] = 0

    def step(self, joint_delta: np.ndarray) -> None:
        """Commands ``q_des = q + u`` to both fingers and simulates one control step (paper, eq. 4); q as read.

        Args:
          joint_delta: u = Δq_des, metres, ``(n, 2)``; negative closes.

        Raises:
          PhysicsError: if a grasp diverged.
        """
        self.command(self.measured_position + joint_delta)

    def command(self, position: np.ndarray) -> None:
        """Holds a commanded position (metres, ``(n, 2)``, clipped to the joint range) for one control step.

        Raises:
          PhysicsError: if a grasp diverged.
        """
        before = self.object_position
        np.clip(position, 0.0, OPEN_M, out=self.commanded_position)
        self.plant.advance(self.commanded_position, self._substeps)
        guard.check(self.plant.warnings(), self.parameters, self.steps)
        self.steps += 1
        self.object_speed = np.abs(self.object_position - before)

    def scene(self, grasp: int) -> tuple[mujoco.MjModel, mujoco.MjData]:
        """Model and data of one grasp as it stands, forwarded, to render or inspect."""
        model = self.plant.batch.get_model(grasp)
        data = self.plant.batch.get_data(grasp)
        mujoco.mj_forward(model, data)
        return model, data
