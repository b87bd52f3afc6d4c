"""Effects of the sensors. Force sensors act at the physics rate, before the electronics' noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .effect import Delay, Effect, Lag


@dataclass
class ForceLag(Effect):
    """The tactile electronics' low-pass filter."""

    time_constant: float = 0.0  # s

    def start(self, n, rng):
        self._lag = Lag(self.time_constant)

    def force(self, f, s):
        return self._lag(f)


@dataclass
class ForceDelay(Effect):
    """The tactile bus: forces arrive later than positions."""

    latency: float = 0.0  # s

    def start(self, n, rng):
        self._delay = Delay(self.latency)

    def force(self, f, s):
        return self._delay(f)


@dataclass
class ReadoutSkew(Effect):
    """Positions wait in a buffer before they are stored with what is newer."""

    age: float = 0.0  # s

    def start(self, n, rng):
        self._buffer, self._oldest = Delay(self.age), None

    def force(self, f, s):  # once in each physics step
        self._oldest = self._buffer(s.q.copy())
        return f

    def position(self, q, s):
        return q if self._oldest is None else q + (self._oldest - s.q)


@dataclass
class ForceBias(Effect):
    """Badly tared sensors, each with its own zero."""

    left: float = 0.0  # N
    right: float = 0.0  # N

    def force(self, f, s):
        return f + np.array([self.left, self.right])


@dataclass
class ForceDrift(Effect):
    """Zeros that wander from the moment of taring, which is each grasp's beginning."""

    left: float = 0.0  # N/s
    right: float = 0.0  # N/s

    def force(self, f, s):
        return f + s.time * np.array([self.left, self.right])


@dataclass
class ForceDeadzone(Effect):
    """A skin that must be pressed through first: that much force is missing from every reading."""

    threshold: float = 0.0  # N

    def force(self, f, s):
        return f - np.clip(f, -self.threshold, self.threshold)


@dataclass
class ForceThreshold(Effect):
    """Another reading: below the threshold the sensor says 0, above it the full force."""

    threshold: float = 0.0  # N

    def force(self, f, s):
        return np.where(np.abs(f) > self.threshold, f, 0.0)


@dataclass
class ForceSaturation(Effect):
    """The end of the sensor's range."""

    full_scale: float = np.inf  # N

    def force(self, f, s):
        return np.clip(f, -self.full_scale, self.full_scale)


@dataclass
class ForceHysteresis(Effect):
    """A rubber skin that springs back late: unloading reads up to ``spread`` (a share) more than loading.

    A play operator in the logarithm of the force, so the loop closes at zero and is as wide as the load is high.
    """

    spread: float = 0.0

    def start(self, n, rng):
        self._out = np.zeros((n, 2))

    def force(self, f, s):
        high = f * (1.0 + self.spread)
        self._out = np.clip(self._out, np.minimum(f, high), np.maximum(f, high))
        return self._out


@dataclass
class ForceCrosstalk(Effect):
    """Each sensor picks up a share of the other's force."""

    share: float = 0.0

    def force(self, f, s):
        return f + self.share * f[:, ::-1]


@dataclass
class ForceGainAsymmetry(Effect):
    """The right sensor's gain is off by a share."""

    right_excess: float = 0.0

    def force(self, f, s):
        return f * [1.0, 1.0 + self.right_excess]


@dataclass
class EncoderBias(Effect):
    """Zeros of the position readings, each finger's own; the servo's own loop knows better."""

    left: float = 0.0  # m
    right: float = 0.0  # m

    def position(self, q, s):
        return q + np.array([self.left, self.right])


@dataclass
class EncoderBiasInLoop(EncoderBias):
    """Another reading: the servo closes its loop on the same wrong zero."""

    def setpoint(self, setpoint, s):
        return setpoint - [self.left, self.right]


@dataclass
class Quantisation(Effect):
    """Stored with few digits, noise and all."""

    position_step: float = 0.0  # m
    force_step: float = 0.0  # N

    def digitise(self, q, f):
        return _round(q, self.position_step), _round(f, self.force_step)


def _round(value: np.ndarray, step: float) -> np.ndarray:
    return np.round(value / step) * step if step > 0 else value
