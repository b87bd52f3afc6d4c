"""A gripper's scene in as many worlds as there are grasps, on a device; one recorded graph steps them all."""

# pyright: standard, reportMissingImports=false, reportArgumentType=false

from __future__ import annotations

import mujoco
import mujoco_warp as mjw
import numpy as np
import torch
import warp as wp
from torch import Tensor

from forcegrasp.gpu.ground_contact import GAP_M, exact_contacts
from forcegrasp.physics.gripper import Gripper
from forcegrasp.physics.inertia import inertia_of_radius

# Fields of the model that are written per grasp, and those that MuJoCo Warp derives from them.
_WRITTEN = ("geom_size", "geom_solimp", "body_inertia", "actuator_biasprm")
_DERIVED = ("geom_aabb", "geom_rbound", "dof_invweight0", "body_invweight0")
# Ten contacts of pads and up to four with the floor, four rows each, and two joint limits.
_CONTACTS, _ROWS = 16, 64
# What must not be NaN nor larger than MuJoCo's mjMAXVAL, and the warning for it. MuJoCo Warp itself goes on.
_SOUND = {
    mujoco.mjtWarning.mjWARN_BADQPOS: "qpos",
    mujoco.mjtWarning.mjWARN_BADQVEL: "qvel",
    mujoco.mjtWarning.mjWARN_BADCTRL: "ctrl",
}
_LARGEST = 1e10
_FULL = mjw.OverflowType.ALL & ~(mjw.OverflowType.ITERATIONS | mjw.OverflowType.LS_ITERATIONS)


class WarpScene:
    """State, parameters and time of ``n`` grasps. Every tensor is float32 and lies on the device.

    Args:
      gripper: what is simulated, see :func:`~forcegrasp.gpu.installation.check_gripper_for_warp`.
      n: number of grasps.
      tier: physics tier, see :meth:`~forcegrasp.physics.gripper.Gripper.compile`.
      device: ``"cpu"`` or ``"cuda"``.

    Raises:
      ConfigError: if there is no such tier.
    """

    def __init__(self, gripper: Gripper, n: int, tier: str, device: str) -> None:
        self._gripper = gripper
        self._host = host = gripper.compile(tier)
        self._warp_device = wp.get_device(device)
        self.n, self.device = n, torch.device(wp.device_to_torch(self._warp_device))
        joints = [host.joint(motor.joint) for motor in gripper.motors]
        self._fingers = [int(joint.qposadr[0]) for joint in joints]
        self._actuators = [host.actuator(motor.actuator).id for motor in gripper.motors]
        geom = host.geom(gripper.object_geom)
        self._body = int(geom.bodyid[0])
        self._geoms = np.flatnonzero(host.geom_bodyid == self._body).tolist()
        self._object = int(host.joint(gripper.object_joint).qposadr[0]) + gripper.axis
        self._readings = [
            slice(s.adr[0], s.adr[0] + s.dim[0]) for s in (host.sensor(f.force_sensor) for f in gripper.fingers)
        ]
        floor = host.geom("floor").id
        host.geom_gap[floor] = GAP_M
        with wp.ScopedDevice(self._warp_device):
            self._model = mjw.put_model(host, dict.fromkeys(_WRITTEN + _DERIVED, n))
            self._model.opt.warn_overflow = 0  # `warnings` says so
            self._model.opt.graph_conditional = self._warp_device.is_cpu or wp.is_conditional_graph_supported()
            self._model.callback.contactfilter = exact_contacts(floor, geom.id)
            self._data = mjw.make_data(host, nworld=n, nconmax=_CONTACTS, njmax=_ROWS)
            self._fields = {name: wp.to_torch(getattr(self._model, name)) for name in _WRITTEN}
            state = ("qpos", "qvel", "qacc_warmstart", "ctrl", "sensordata", "overflow")
            self._state = {name: wp.to_torch(getattr(self._data, name)) for name in state}
            self._start = torch.as_tensor(host.key_qpos[0], dtype=torch.float32, device=self.device)
            mjw.step(self._model, self._data)  # loads every kernel, which can't be done while recording
            with wp.ScopedCapture() as capture:
                for _ in range(round(gripper.period_s / host.opt.timestep)):
                    mjw.step(self._model, self._data)
            self._graph = capture.graph

    @property
    def position(self) -> Tensor:
        """Finger positions (left, right), metres, ``(n, 2)``; 0 is closed."""
        return self._state["qpos"][:, self._fingers]

    @property
    def object_position(self) -> Tensor:
        """Object position along the grasp axis, metres, ``(n,)``."""
        return self._state["qpos"][:, self._object] - self._start[self._object]

    @property
    def pad_force(self) -> Tensor:
        """Sum of each finger's force sensor at the last physics step, before f_α, newtons, ``(n, 2)``."""
        return torch.stack([self._state["sensordata"][:, part].sum(-1) for part in self._readings], dim=1)

    def reset(self, ids: np.ndarray, base: dict[str, np.ndarray]) -> None:
        """Opens these grippers and puts objects of these base parameters between the fingers; other rows stay."""
        rows = torch.as_tensor(ids, device=self.device)

        def put(field: Tensor, index: list[int], column: int, values: np.ndarray) -> None:
            field[rows[:, None], index, column] = self._tensor(values)[:, None]

        rows_of = {"geom": self._geoms, "actuator": self._actuators}
        put(self._fields["geom_size"], self._geoms, 0, base["radius_m"])  # cylinder, and sphere of the fast tier
        for name, values in base.items():
            for write in self._gripper.parameters[name].writes:
                put(self._fields[write.field], rows_of[write.field.split("_")[0]], write.column, write.sign * values)
        inertia = inertia_of_radius(self._host, self._gripper, base["radius_m"])
        self._fields["body_inertia"][rows, self._body] = self._tensor(inertia)
        for name, state in self._state.items():
            state[rows] = self._start if name == "qpos" else 0
        self._state["qpos"][rows, self._object] += self._tensor(base["offset_m"])
        groups = mjw.SetConstGroup.FIXED | mjw.SetConstGroup.INERT0
        with wp.ScopedDevice(self._warp_device):
            mjw.set_const(self._model, self._data, groups)

    def advance(self, command_m: Tensor) -> None:
        """Holds commanded finger positions, metres, ``(n, 2)``, for one control step."""
        self._state["ctrl"][:, self._actuators] = command_m
        wp.capture_launch(self._graph)

    def warnings(self) -> Tensor:
        """Whether each of MuJoCo's warnings holds, ``(n, kinds)``, as far as MuJoCo Warp's data show it."""
        warnings = torch.zeros(self.n, mujoco.mjtWarning.mjNWARNING.value, dtype=torch.bool, device=self.device)
        for kind, name in _SOUND.items():
            warnings[:, kind.value] = ~(self._state[name].abs() < _LARGEST).all(-1)
        warnings[:, mujoco.mjtWarning.mjWARN_CONTACTFULL.value] = self._state["overflow"].bitwise_and(_FULL) != 0
        return warnings

    def _tensor(self, values: np.ndarray) -> Tensor:
        return torch.as_tensor(values, dtype=torch.float32, device=self.device)
