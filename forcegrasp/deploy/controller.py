"""From readings to commands, once per period: what training built from transforms, in numpy, and within limits."""

from __future__ import annotations

import dataclasses
import logging
import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from forcegrasp.assets import DEFAULT_GRIPPER
from forcegrasp.deploy.contract import LAST_TOUCH, Contract
from forcegrasp.deploy.contract_file import baseline_folder, read_contract
from forcegrasp.deploy.policies import ForcePI, Policy, load_policy
from forcegrasp.errors import DeployError
from forcegrasp.observation import PARTS, Readings

_log = logging.getLogger("forcegrasp.deploy")


class GraspController:
    """Brings all fingertip forces to a goal: ``reset(goal_n)``, then ``step(q, f)`` once per control period.

    Whatever the policy says: a command is within Δq_max of the position read and within the joint range; above the
    force ceiling no motor closes further; and where a reading or an action can't be trusted, the last command is
    held and ``fault`` says why. A held step leaves the memory (contact, observations, last action, integral) as it
    was, and the next good reading goes on from there. Each kind of fault is logged once per grasp, as a warning of
    the logger ``forcegrasp.deploy``.

    Attributes:
      fault: why the last step held, or did not close further, in one line; None if all is well.
      action: the policy's last action, clipped to [−1, 1], ``(motors,)``.
      delta_m: Δq of the last command that was not a hold, m or rad, ``(motors,)``.

    Args:
      policy: what decides.
      contract: how readings become observations and actions commands; and the limits.
    """

    def __init__(self, policy: Policy, contract: Contract) -> None:
        self.policy, self.contract = policy, contract
        self.goal_n: float | None = None
        self.fault: str | None = None

    @classmethod
    def load(
        cls, folder: Path | str, ceiling_n: float | None = None, gripper: Path | str | None = None
    ) -> GraspController:
        """The controller of a folder that ``forcegrasp export`` wrote.

        Args:
          folder: with ``contract.json`` and, if a network decides, ``policy.onnx``.
          ceiling_n: another force ceiling than the contract's, newtons.
          gripper: what the robot has, as for :meth:`baseline`; policies of another one are refused.

        Raises:
          DeployError: if the folder is missing, damaged, of another gripper, or can't be run here.
          ValueError: if the ceiling is below the smallest goal, or above what a sensor can read.
        """
        policy, contract = load_policy(folder)
        if gripper is not None:
            own, _ = read_contract(baseline_folder(gripper))
            if contract.gripper != own.gripper:
                raise DeployError(f"{folder}: made for {contract.gripper}; the robot has {own.gripper}")
        return cls(policy, _with_ceiling(contract, ceiling_n))

    @classmethod
    def baseline(
        cls, ceiling_n: float | None = None, gripper: Path | str = DEFAULT_GRIPPER, **gains: float
    ) -> GraspController:
        """The hand-written controller of a gripper.

        Args:
          ceiling_n: another force ceiling than the gripper's, newtons.
          gripper: one that comes with the package, by name; or the folder that ``forcegrasp export force_pi`` wrote.
          gains: those of :class:`ForcePIGains` that are to be others.

        Raises:
          DeployError: if there is no such gripper, or the folder is damaged or of a trained policy.
          ValueError: if the ceiling is below the smallest goal, or above what a sensor can read.
        """
        contract, own = read_contract(baseline_folder(gripper))
        if isinstance(own, bytes):
            raise DeployError(f"gripper={gripper}: holds a trained policy, which GraspController.load runs")
        contract = _with_ceiling(contract, ceiling_n)
        return cls(ForcePI(contract, dataclasses.replace(own, **gains)), contract)

    def reset(self, goal_n: float) -> None:
        """Begins a grasp: forgets all readings and commands. The fingers should be open and touch nothing.

        Args:
          goal_n: goal force of each finger, newtons.

        Raises:
          ValueError: if the policy was not trained for that goal, or it is above the ceiling; nothing is changed.
        """
        low, high = self.contract.goal_range_n
        if not low <= goal_n <= min(high, self.contract.ceiling_n):
            raise ValueError(
                f"goal_n={goal_n}: must lie in [{low:g}, {high:g}] N, which was trained,"
                f" and not above the ceiling of {self.contract.ceiling_n:g} N"
            )
        self.goal_n = float(goal_n)
        self.policy.reset()
        self.fault = None
        size = self.contract.action_size
        self.action, self.delta_m = np.zeros(size, np.float32), np.zeros(size)
        self._had_contact: np.ndarray | None = None  # None until the first good reading
        self._touch_force = np.float32(0)  # the largest force that was read of a finger with contact
        self._position: np.ndarray | None = None  # of the last good reading
        self._commanded: np.ndarray | None = None
        self._time: float | None = None  # of the last good reading
        self._reported: set[str] = set()

    def step(self, q: ArrayLike, f: ArrayLike, t: float | None = None) -> np.ndarray:
        """The command for one control period.

        Args:
          q: positions of the motors (left, right, or the one), m or rad.
          f: force readings, newtons, one for each of the contract's force channels.
          t: when they were read, seconds on any clock that only moves forward; without it, staleness goes unnoticed.

        Returns:
          q_des of the motors, m or rad, ``(motors,)``.

        Raises:
          RuntimeError: before the first reset.
          DeployError: if nothing is to be held yet: no good position was read since the reset. Nothing was commanded.
        """
        if self.goal_n is None:
            raise RuntimeError("call reset(goal_n) before the first step")
        gripper = self.contract.gripper
        position, force = _numbers(q, len(gripper.positions)), _numbers(f, len(gripper.forces))
        fault = self._doubt(position, force, t)
        if fault:
            return self._hold(position, fault)
        assert position is not None  # or it would be in doubt
        assert force is not None
        parts = self._observe(position, force)
        raw = np.asarray(self.policy.act(parts), np.float32)
        if raw.shape != self.action.shape:
            return self._hold(position, f"action does not fit: {_show(raw.ravel())}, not one per motor; holding")
        if not np.isfinite(raw).all():
            return self._hold(position, f"action is not finite: the policy gave {_show(raw)}")
        self.action = np.clip(raw, -1, 1)
        delta = (self.action * np.float32(self.contract.max_delta_m) * self._bias(parts)).astype(np.float64)
        fault = None
        if force.max() > self.contract.ceiling_n:
            # any reading: forces come from both sides, and the other sensor may be dead
            delta = np.maximum(delta, 0.0)
            fault = f"force is above the ceiling of {self.contract.ceiling_n:.4g} N: {_show(force)} N; not closing"
        self._report(fault)
        self.delta_m = delta
        self._commanded = np.clip(position + delta, *self.contract.joint_range_m)
        return self._commanded.copy()

    def _doubt(self, position: np.ndarray | None, force: np.ndarray | None, t: float | None) -> str | None:
        """Why a reading can't be trusted, or None; the part before the colon is the kind of fault."""
        gripper = self.contract.gripper
        for name, unit, value, bounds in (
            ("position", gripper.unit, position, self.contract.position_reading_m),
            ("force", "N", force, self.contract.force_reading_n),
        ):
            if value is None:
                return f"{name} reading does not fit: {gripper.name} needs {gripper.needs}; holding"
            if not np.isfinite(value).all():
                return f"{name} reading is not finite: {_show(value)} {unit}; holding"
            if value.min() < bounds[0] or value.max() > bounds[1]:
                return f"{name} reading can't be true: {_show(value)} is not in {_show(bounds)} {unit}; holding"
        if t is None:
            return None
        if not math.isfinite(t):
            return f"time of the reading is not finite: {t} s; holding"
        gap = math.inf if self._time is None else t - self._time
        if gap <= 0:
            return f"reading is stale: its time {t:.3f} s is not after {self._time:.3f} s, the last one's; holding"
        shortest, longest = self.contract.gap_s
        if gap < shortest:
            return f"reading comes too soon: {gap:.3f} s after the last one, not {self.contract.control_period_s:g} s"
        first, self._time = self._time is None, t
        if gap > longest and not first:
            return f"readings have a gap: {gap:.3f} s, more than {longest:g} s; holding for one step"
        return None

    def _observe(self, position: np.ndarray, force: np.ndarray) -> dict[str, np.ndarray]:
        """The parts of o(t), float32 as in training; remembers contact, h(t) = (f > f_θ) ∨ h(t−1) with h(0) = 0."""
        contract, position, force = self.contract, position.astype(np.float32), force.astype(np.float32)
        if self._had_contact is None or self._position is None:
            self._had_contact = np.zeros(force.shape, np.float32)
        else:
            contact = force > contract.contact_threshold_n
            if contract.stall is not None:  # an effort that moves the motor says nothing of contact
                contact &= np.abs(position - self._position) < contract.stall
            self._had_contact = np.maximum(self._had_contact, contact).astype(np.float32)
            self._touch_force = np.maximum(self._touch_force, np.max(force * self._had_contact))
        self._position = position
        scale, offset = np.float32(contract.position_scale_per_m), np.float32(contract.position_offset)
        goal = np.float32(self.goal_n)
        readings = Readings(position, force, goal, self.action, self._had_contact, scale, offset)
        return {name: part.on_robot(readings) for name, part in PARTS.items() if part.on_robot}

    def _bias(self, parts: dict[str, np.ndarray]) -> np.ndarray | np.float32:
        """φ of each motor (paper, eq. 7), in [0, 1]; the same for all unless each has a force reading of its own."""
        contract, touched = self.contract, parts["had_contact"] > 0.5
        if not contract.inductive_bias:
            return np.float32(1)
        one_to_one = contract.gripper.one_to_one
        if touched.all():
            error = np.abs(parts["force_error"])
            near_goal = 1 - (error if one_to_one else error.mean()) / np.float32(self.goal_n)
            return np.maximum(near_goal, np.float32(contract.bias_floor))
        closing = np.float32(1)
        if contract.gentle_n and touched.any():
            hard = np.minimum(np.float32(LAST_TOUCH) * self._touch_force, np.float32(contract.gentle_n))
            closing = np.minimum(np.sqrt(np.float32(self.goal_n) / hard), closing)
        return np.where(touched, np.float32(contract.bias_one_contact), closing) if one_to_one else closing

    def _hold(self, position: np.ndarray | None, fault: str) -> np.ndarray:
        """The last command again; before the first one, the position where the fingers stand."""
        if self._commanded is None:
            low, high = self.contract.position_reading_m
            if position is None or not ((position >= low) & (position <= high)).all():
                raise DeployError(f"{fault}, but no good position was read since the reset: there is nothing to hold")
            self._commanded = np.clip(position, *self.contract.joint_range_m)
        self._report(fault)
        return self._commanded.copy()

    def _report(self, fault: str | None) -> None:
        """Says what is wrong, and logs it unless that kind of fault was already logged in this grasp."""
        self.fault = fault
        if fault:
            kind = fault.partition(":")[0]
            if kind not in self._reported:
                _log.warning(fault)
            self._reported.add(kind)


def _with_ceiling(contract: Contract, ceiling_n: float | None) -> Contract:
    return contract if ceiling_n is None else dataclasses.replace(contract, ceiling_n=float(ceiling_n))


def _numbers(reading: Any, count: int) -> np.ndarray | None:
    """A reading as float64 ``(count,)``, where one number may come alone; None if it is something else."""
    try:
        numbers = np.atleast_1d(np.asarray(reading, np.float64))
    except (TypeError, ValueError):
        return None
    return numbers if numbers.shape == (count,) else None


def _show(values: Iterable[float]) -> str:
    return "[" + ", ".join(f"{v:.4g}" for v in values) + "]"
