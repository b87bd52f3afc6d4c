"""Effects of the catalogue by another law: whoever says the kind of effect is right."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .drive import FingerCompliance
from .effect import Delay, Effect, Lag
from .scene import STEP_S


@dataclass
class SmoothFriction(Effect):
    """Dry friction that vanishes smoothly at rest, so that the finger creeps."""

    level: float = 0.0  # N
    width: float = 5e-4  # m/s

    def motor(self, s):
        return -self.level * np.tanh(s.v / self.width)


@dataclass
class SmoothStribeck(Effect):
    """The same, larger at low speed."""

    breakaway: float = 0.0  # N
    sliding: float = 0.0  # N
    width: float = 5e-4  # m/s
    stribeck: float = 4e-3  # m/s

    def motor(self, s):
        level = self.sliding + (self.breakaway - self.sliding) * np.exp(-np.abs(s.v) / self.stribeck)
        return -level * np.tanh(s.v / self.width)


@dataclass
class SmoothTable(Effect):
    """The object's friction on its table, by a smooth law."""

    level: float = 0.0  # N
    width: float = 1e-3  # m/s

    def table(self, s):
        return -self.level * np.tanh(s.ov / self.width)


@dataclass
class DampedFinger(FingerCompliance):
    """A finger of rubber: it bends slowly."""

    damping_ratio: float = 1.5


@dataclass
class RingingFinger(FingerCompliance):
    """A finger of spring steel."""

    damping_ratio: float = 0.05


@dataclass
class Suction(Effect):
    """A pull that is constant while a pad touches, and gone at once when it does not."""

    pull: float = 0.0  # N

    def press(self, s):
        return -self.pull * (s.depth > 0)


class _TwoPoles:
    """A filter of two equal poles; it is as late as one of the whole time constant."""

    def __init__(self, time_constant: float) -> None:
        self._first, self._second = Lag(time_constant / 2), Lag(time_constant / 2)

    def __call__(self, value: np.ndarray) -> np.ndarray:
        return self._second(self._first(value))


@dataclass
class SecondOrderDrive(Effect):
    """A set point filter of two poles."""

    time_constant: float = 0.0  # s

    def start(self, n, rng):
        self._lag = _TwoPoles(self.time_constant)

    def setpoint(self, setpoint, s):
        return self._lag(setpoint)


@dataclass
class SecondOrderSensor(Effect):
    """The same in the force sensor."""

    time_constant: float = 0.0  # s

    def start(self, n, rng):
        self._lag = _TwoPoles(self.time_constant)

    def force(self, f, s):
        return self._lag(f)


@dataclass
class RestlessDelay(Effect):
    """A bus whose delay wanders by a third of itself."""

    latency: float = 0.0  # s

    def start(self, n, rng):
        self._early, self._late = Delay(self.latency * 2 / 3), Delay(self.latency * 4 / 3)
        self._rng = rng
        self._which = rng.random((n, 2)) < 0.5
        self._until = 0.0

    def setpoint(self, setpoint, s):
        if s.time >= self._until:
            self._which, self._until = self._rng.random(setpoint.shape) < 0.5, s.time + 0.2
        early, late = self._early(setpoint), self._late(setpoint)
        return np.where(self._which, early, late)


@dataclass
class SoftSaturation(Effect):
    """An amplifier that bends before it clips."""

    full_scale: float = np.inf  # N

    def force(self, f, s):
        return f if np.isinf(self.full_scale) else self.full_scale * np.tanh(f / self.full_scale)


@dataclass
class SoftDeadzone(Effect):
    """A skin that comes to feel little by little."""

    threshold: float = 0.0  # N

    def force(self, f, s):
        return f if self.threshold == 0 else f - self.threshold * np.tanh(f / self.threshold)


@dataclass
class HertzPads(Effect):
    """Round rubber pads on top of the base contact: force ∝ depth^1.5."""

    at_one_mm: float = 0.0  # N

    def press(self, s):
        return self.at_one_mm * (np.maximum(s.depth, 0.0) / 1e-3) ** 1.5


@dataclass
class WideHysteresis(Effect):
    """A skin whose loop is equally wide at any load."""

    width: float = 0.0  # N

    def start(self, n, rng):
        self._out = np.zeros((n, 2))

    def force(self, f, s):
        self._out = np.clip(self._out, f - self.width / 2, f + self.width / 2)
        return np.where(f > 0, np.maximum(self._out, 0.0), 0.0)


@dataclass
class SettlingDrift(Effect):
    """Zeros that wander and come to rest."""

    left: float = 0.0  # N, in the end
    right: float = 0.0  # N
    settling: float = 3.0  # s

    def force(self, f, s):
        return f + (1 - np.exp(-s.time / self.settling)) * np.array([self.left, self.right])


@dataclass
class Tilt(Effect):
    """Gravity along a gripper that lies on its side: both fingers are pulled the same way."""

    weight: float = 0.0  # N

    def motor(self, s):
        return self.weight * np.broadcast_to([1.0, -1.0], s.q.shape)


@dataclass
class SoftRate(Effect):
    """A drive that nears its set point at a speed that bends towards a limit."""

    speed: float = np.inf  # m/s
    time_constant: float = 0.01  # s

    def start(self, n, rng):
        self._at = None

    def setpoint(self, setpoint, s):
        if self._at is None or np.isinf(self.speed):
            self._at = setpoint
            return setpoint
        wanted = (setpoint - self._at) / self.time_constant
        self._at = self._at + STEP_S * self.speed * np.tanh(wanted / self.speed)
        return self._at
