"""Many grasps at once, one command at a time: what the learning environment runs on."""

from __future__ import annotations

import dataclasses
from typing import Protocol, runtime_checkable

import mujoco
import numpy as np
from jaxtyping import Float, Int

from forcegrasp.physics import guard
from forcegrasp.physics.gripper import Gripper
from forcegrasp.physics.gripper_file import default_gripper
from forcegrasp.physics.parameters import GraspParameters
from forcegrasp.physics.plant import Plant, write_base


@runtime_checkable
class Variation(Protocol):
    """What makes one gripper differ from another."""

    def attach(self, plant: Plant) -> None:
        """Prepares a plant, once."""
        ...

    def draw(self, rng: np.random.Generator, ids: Int[np.ndarray, " rows"]) -> dict[str, Float[np.ndarray, " rows"]]:
        """Draws anew for these rows, before they are reset; returns base parameters, each ``(len(ids),)``."""
        ...


class GraspSimulator:
    """Simulates ``n`` grasps of a gripper, each with its own parameters, one control step at a time.

    Results do not depend on the number of threads, on ``n``, or on what a slot simulated before, to the last bit.

    Args:
      n: number of grasps.
      tier: physics tier, ``"reference"`` or ``"fast"``, see :meth:`~forcegrasp.physics.gripper.Gripper.compile`.
      threads: threads of the engine; 0 uses every core that this process may use.
      variation: draws the gripper's own parameters and effects at each reset; nominal and none by default.
      gripper: what is simulated; the paper's by default.

    Raises:
      ConfigError: if there is no such tier.
    """

    def __init__(
        self,
        n: int,
        tier: str = "reference",
        threads: int = 0,
        variation: Variation | None = None,
        gripper: Gripper | None = None,
    ) -> None:
        self.gripper = gripper = gripper or default_gripper()
        self.plant = plant = Plant(gripper, n, tier, threads)
        self.model = plant.model
        self.n = n
        self.steps = np.zeros(n, dtype=np.int64)  #: control steps since the grasp was reset, ``(n,)``
        self.parameters = nominal_grasps(gripper, n)
        #: q_des of the last step, m or rad, ``(n, motors)``
        self.commanded_position = np.full((n, plant.motors), gripper.stroke)
        self.object_speed = np.zeros(n)  #: ``|o_y(t) − o_y(t−1)|``, metres per control step, ``(n,)``
        self._substeps = max(1, round(gripper.period_s / plant.dt))
        self._variation = variation
        if variation is not None:
            variation.attach(plant)
        self.reset(self.parameters)

    @property
    def joint_position(self) -> Float[np.ndarray, "{self.n} {self.plant.motors}"]:
        """Positions of the motors (left, right, or the one), m or rad, ``(n, motors)``; 0 is closed."""
        return self.plant.position.copy()

    @property
    def object_position(self) -> Float[np.ndarray, " {self.n}"]:
        """Object position along the grasp axis, metres, ``(n,)``."""
        return self.plant.object_position

    @property
    def force(self) -> Float[np.ndarray, "{self.n} 2"]:
        """Fingertip forces (left, right), newtons, ``(n, 2)``.

        A finger's reading is the sum over its contacts of the normal and both signed tangential components at the last
        physics step, times f_α (authors' code).
        """
        return self.plant.force.copy()

    @property
    def measured_position(self) -> Float[np.ndarray, "{self.n} {self.plant.motors}"]:
        """What the encoders say, before noise, ``(n, motors)``; the positions themselves if nothing changes them."""
        return self.plant.measured_position

    @property
    def measured_force(self) -> Float[np.ndarray, "{self.n} {len(self.gripper.forces)}"]:
        """What the force readings say, before noise, newtons, ``(n, channels)``."""
        return self.plant.measured_force

    def reset(
        self,
        parameters: GraspParameters,
        ids: Int[np.ndarray, " rows"] | None = None,
        rng: np.random.Generator | None = None,
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
        training = self.gripper.training
        if training.servo_gain in drawn:
            parameters = dataclasses.replace(parameters, b2=drawn[training.servo_gain])
        merged = self.parameters.as_array()
        merged[ids] = parameters.as_array()
        self.parameters = GraspParameters.from_array(merged)
        base = drawn | base_parameters(self.gripper, parameters)
        self.plant.reset(ids, write_base(self.plant, ids, base))
        self.commanded_position[ids] = self.gripper.stroke
        self.object_speed[ids] = 0.0
        self.steps[ids] = 0

    def step(self, joint_delta: Float[np.ndarray, "{self.n} {self.plant.motors}"]) -> None:
        """Commands ``q_des = q + u`` to the motors and simulates one control step (paper, eq. 4); q as read.

        Args:
          joint_delta: u = Δq_des, m or rad, ``(n, motors)``; negative closes.

        Raises:
          PhysicsError: if a grasp diverged.
        """
        self.command(self.measured_position + joint_delta)

    def command(self, position: Float[np.ndarray, "{self.n} {self.plant.motors}"]) -> None:
        """Holds a commanded position (m or rad, ``(n, motors)``, clipped to the stroke) for one control step.

        Raises:
          PhysicsError: if a grasp diverged.
        """
        before = self.object_position
        np.clip(position, 0.0, self.gripper.stroke, out=self.commanded_position)
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


def nominal_grasps(gripper: Gripper, n: int) -> GraspParameters:
    """``n`` equal grasps: an object of middling softness and the description's radius in the middle."""
    training, radius = gripper.training, gripper.parameters["radius_m"].nominal
    force = training.max_force_n * float(training.force_scale(0.5)) / 2
    row = np.array([[0.5], [gripper.nominal_gain], [radius], [0.0], [force]])
    return GraspParameters(*np.broadcast_to(row, (5, n)))


def base_parameters(gripper: Gripper, grasps: GraspParameters) -> dict[str, Float[np.ndarray, " n"]]:
    """What grasps mean for a gripper: base parameter → ``(n,)``."""
    training = gripper.training
    base = {training.servo_gain: grasps.b2} if training.servo_gain else {}
    base |= {name: np.asarray(training.at(name, grasps.kappa)) for name in training.softness}
    return base | {"radius_m": grasps.radius_m, "offset_m": grasps.offset_m}
