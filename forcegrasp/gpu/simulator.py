"""Many grasps at once, in torch tensors on a device: GraspSimulator's twin on MuJoCo Warp."""

# pyright: standard

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from forcegrasp.config import PhysicsConfig
from forcegrasp.gpu.installation import check_engine, check_gripper_for_warp, start_warp
from forcegrasp.physics import GraspParameters, guard
from forcegrasp.physics.gripper import Gripper
from forcegrasp.physics.gripper_file import default_gripper
from forcegrasp.physics.simulator import base_parameters, nominal_grasps


class WarpGraspSimulator:
    """Simulates ``n`` grasps of a gripper, each with its own parameters, one control step at a time.

    Every tensor is float32, lies on the device, and is the reader's own. There are no effects: what is measured is
    true. On a GPU, sums are made in any order: runs agree to rounding only.

    Args:
      n: number of grasps.
      tier: physics tier, ``"reference"`` or ``"fast"``, see :meth:`~forcegrasp.physics.gripper.Gripper.compile`.
      device: ``"cpu"`` or ``"cuda"``.
      gripper: what is simulated; the paper's by default.

    Raises:
      ConfigError: if there is no such tier, MuJoCo Warp is not installed, there is no such device, or the engine does
        not take the gripper.
    """

    def __init__(self, n: int, tier: str = "fast", device: str = "cpu", gripper: Gripper | None = None) -> None:
        self.gripper = gripper = gripper or default_gripper()
        check_engine(PhysicsConfig(tier, engine="warp", device=device))
        check_gripper_for_warp(gripper)
        start_warp()
        from forcegrasp.gpu.scene import WarpScene

        self._scene = scene = WarpScene(gripper, n, tier, device)
        self.n, self.device = n, scene.device
        self.steps = torch.zeros(n, dtype=torch.int64, device=self.device)  #: control steps since the reset, ``(n,)``
        self.parameters = nominal_grasps(gripper, n)
        self._force_scale = torch.ones(n, 1, device=self.device)
        self.commanded_position = torch.full(
            (n, 2), gripper.stroke, device=self.device
        )  #: q_des of the last step, metres
        self.object_speed = torch.zeros(n, device=self.device)  #: |o_y(t) − o_y(t−1)|, metres per control step
        self.reset(self.parameters)

    @property
    def joint_position(self) -> Tensor:
        """Finger positions (left, right), metres, ``(n, 2)``; 0 is closed."""
        return self._scene.position

    @property
    def object_position(self) -> Tensor:
        """Object position along the grasp axis, metres, ``(n,)``."""
        return self._scene.object_position

    @property
    def force(self) -> Tensor:
        """Fingertip forces (left, right), newtons, ``(n, 2)``, see :attr:`GraspSimulator.force`."""
        return self._scene.pad_force * self._force_scale

    @property
    def measured_position(self) -> Tensor:
        """What the encoders say, before noise: the positions themselves, metres, ``(n, 2)``."""
        return self.joint_position

    @property
    def measured_force(self) -> Tensor:
        """What the force sensors say, before noise: the true forces, newtons, ``(n, 2)``."""
        return self.force

    def reset(
        self, parameters: GraspParameters, ids: np.ndarray | None = None, rng: np.random.Generator | None = None
    ) -> None:
        """Opens the gripper and puts an object of the given parameters between the fingers.

        Args:
          parameters: one set per grasp that is reset.
          ids: the slots to reset, in ascending order; all of them by default.
          rng: not used: nothing is drawn here.
        """
        ids = np.arange(self.n) if ids is None else np.asarray(ids)
        if len(parameters) != len(ids):
            raise ValueError(f"got parameters of {len(parameters)} grasps for {len(ids)} slots")
        if len(ids) == 0:
            return
        merged = self.parameters.as_array()
        merged[ids] = parameters.as_array()
        self.parameters = GraspParameters.from_array(merged)
        base = base_parameters(self.gripper, parameters)
        self._scene.reset(ids, base)
        rows = torch.as_tensor(ids, device=self.device)
        scale = base.get("force_scale", np.ones(len(ids)))
        self._force_scale[rows, 0] = torch.as_tensor(scale, dtype=torch.float32, device=self.device)
        # not in place: somebody may have read them
        self.commanded_position = self.commanded_position.index_fill(0, rows, self.gripper.stroke)
        self.object_speed = self.object_speed.index_fill(0, rows, 0.0)
        self.steps = self.steps.index_fill(0, rows, 0)

    def step(self, joint_delta: Tensor) -> None:
        """Commands ``q_des = q + u`` to both fingers and simulates one control step (paper, eq. 4).

        Args:
          joint_delta: u = Δq_des, metres, ``(n, 2)``; negative closes.

        Raises:
          PhysicsError: if a grasp diverged.
        """
        self.command(self.joint_position + joint_delta)

    def command(self, position: Tensor) -> None:
        """Holds a commanded position (metres, ``(n, 2)``, clipped to the joint range) for one control step.

        Raises:
          PhysicsError: if a grasp diverged.
        """
        before = self.object_position
        self.commanded_position = position.float().clamp(0.0, self.gripper.stroke)
        self._scene.advance(self.commanded_position)
        warnings = self._scene.warnings()
        if warnings.any():  # waits for the device: once per control step, in which torchrl asks whether all is done
            guard.check(warnings.cpu().numpy(), self.parameters, self.steps.cpu().numpy())
        self.steps = self.steps + 1
        self.object_speed = (self.object_position - before).abs()
