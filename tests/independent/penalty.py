"""The same hand without MuJoCo: point masses on a line and a Hunt-Crossley contact."""

from __future__ import annotations

import numpy as np

from .scene import FINGER_KG, GUIDE_DAMPING, OPEN_M, ROTOR_KG, STEP_S, Servo

_OBJECT_KG = 0.4
_REFERENCE_N, _SINK = 0.15, 0.24  # a pad sinks in by SINK · rho under this force, as in MuJoCo
_DAMPING_S_PER_M = 12.0
_STOP_N_PER_M, _STOP_N_S_PER_M = 2e4, 60.0
_KAPPA, _DRAG = [0.0, 0.5, 1.0], [82.0, 52.0, 41.0]  # what the floor does to an object of that softness, N s/m


class PenaltyPlant:
    """Drop-in for :class:`~.scene.MujocoPlant`, with a force ∝ depth^``power`` (MuJoCo's grows with about 3.5)."""

    def __init__(
        self,
        rho: np.ndarray,
        radius: np.ndarray,
        offset: np.ndarray,
        servo: Servo | None,
        power: float = 2.5,
        friction: float = 1.0,
    ) -> None:
        self._servo, self._radius = servo, radius[:, None]
        self._power, self._sink = power, _SINK * rho[:, None]
        self._drag = friction * np.interp((rho - 0.003) / 0.007, _KAPPA, _DRAG)
        self._mass = FINGER_KG + (ROTOR_KG if servo else 0.0)
        self.q, self.v = np.full((len(rho), 2), OPEN_M), np.zeros((len(rho), 2))
        self.o, self.ov = offset.astype(float), np.zeros(len(rho))
        self.touch = self.load = np.zeros((len(rho), 2))

    def step(self, setpoint: np.ndarray, finger: np.ndarray, press: np.ndarray, table: np.ndarray) -> None:
        """One physics step: forces at the old state, then velocities, then positions."""
        side = np.array([1.0, -1.0])  # the left finger pushes the object towards +y
        depth = np.maximum(0.0, self._radius - self.q - side * self.o[:, None])
        rate = -self.v - side * self.ov[:, None]
        spring = _REFERENCE_N * (depth / self._sink) ** self._power
        self.touch = spring * np.maximum(0.0, 1.0 + _DAMPING_S_PER_M * rate) + press
        beyond = self.q - np.clip(self.q, 0.0, OPEN_M)
        stop = -_STOP_N_PER_M * beyond - np.where(beyond != 0.0, _STOP_N_S_PER_M * self.v, 0.0)
        self.load = self.touch + stop
        motor = self._servo.force(setpoint, self.q, self.v) if self._servo else 0.0
        self.v = self.v + STEP_S * (motor + finger + self.load - GUIDE_DAMPING * self.v) / self._mass
        self.q = self.q + STEP_S * self.v
        pushed = self.touch[:, 0] - self.touch[:, 1] + table
        # The floor's drag is stiff against the object's mass: implicit.
        self.ov = (self.ov + STEP_S * pushed / _OBJECT_KG) / (1.0 + STEP_S * self._drag / _OBJECT_KG)
        self.o = self.o + STEP_S * self.ov

    def check(self) -> None:
        """Raises if a grasp diverged."""
        if not np.all(np.isfinite(self.q)):
            raise FloatingPointError("a grasp diverged")
