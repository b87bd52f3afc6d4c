"""Effects that are in nobody's catalogue: the honest diagnosis is "none that I know"."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .effect import Effect, Lag
from .scene import STEP_S


@dataclass
class MotorCogging(Effect):
    """Magnets and gear teeth: a force that depends on the position, with its period."""

    amplitude: float = 0.0  # N
    period: float = 0.004  # m

    def motor(self, s):
        return self.amplitude * np.sin(2 * np.pi * s.q / self.period + [0.4, 2.1])


@dataclass
class MotorFade(Effect):
    """A motor that warms up by its squared force and loses force by that."""

    loss: float = 0.0  # share of the force lost at full warmth
    warm_up: float = 2.0  # s
    warm_force: float = 0.15  # N that heats to full warmth if held

    def start(self, n, rng):
        self._warmth = np.zeros((n, 2))

    def motor(self, s):
        force = s.motor_force()
        heating = np.minimum((force / self.warm_force) ** 2, 2.0)
        self._warmth = self._warmth + STEP_S / self.warm_up * (heating - self._warmth)
        return -self.loss * np.minimum(self._warmth, 1.0) * force


@dataclass
class DirectionalGain(Effect):
    """A drive stage that pushes harder when closing than when opening."""

    closing_excess: float = 0.0

    def motor(self, s):
        return self.closing_excess * np.minimum(s.motor_force(), 0.0)


@dataclass
class EccentricEncoder(Effect):
    """An encoder disc off its axis: an error that repeats with every turn."""

    amplitude: float = 0.0  # m
    turn: float = 0.012  # m

    def position(self, q, s):
        return q + self.amplitude * np.sin(2 * np.pi * q / self.turn + [0.0, 1.3])


@dataclass
class CurvedForceGain(Effect):
    """A sensor whose reading bends upwards with the force."""

    per_newton: float = 0.0

    def force(self, f, s):
        return f * (1.0 + self.per_newton * np.abs(f))


@dataclass
class TipInertia(Effect):
    """The mass in front of the sensor: it reads when the finger accelerates."""

    mass: float = 0.0  # kg
    filter: float = 0.008  # s

    def start(self, n, rng):
        self._v, self._lag = np.zeros((n, 2)), Lag(self.filter)

    def force(self, f, s):
        acceleration = self._lag((s.v - self._v) / STEP_S)
        self._v = s.v
        return f + self.mass * acceleration


@dataclass
class StalePositions(Effect):
    """Now and then a position is the one of the sample before."""

    chance: float = 0.0

    def start(self, n, rng):
        self.rng, self._last = rng, None

    def digitise(self, q, f):
        if self._last is not None:
            q = np.where(self.rng.random(q.shape) < self.chance, self._last, q)
        self._last = q
        return q, f


@dataclass
class RoughGuide(Effect):
    """A guide that is dirty over a stretch: more viscous drag there."""

    drag: float = 0.0  # N s/m
    centre: float = 0.032  # m
    width: float = 0.004  # m

    def motor(self, s):
        return -self.drag * s.v * np.exp(-(((s.q - self.centre) / self.width) ** 2))
