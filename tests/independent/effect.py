"""What an effect may do to a simulated grasp, and bricks that several effects are built of."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

import numpy as np

from .scene import STEP_S, Servo


@dataclass
class State:
    """Where ``n`` grasps stand; per finger ``(n, 2)``, left first, positive opens. Effects read it."""

    servo: Servo
    q: np.ndarray  # the motors' encoders
    v: np.ndarray
    o: np.ndarray  # objects along y, (n,)
    ov: np.ndarray
    depth: np.ndarray  # how far a pad is inside the object's outline; negative: clear of it
    f: np.ndarray  # force on the pads before any sensor, N
    setpoint: np.ndarray
    load: np.ndarray  # what pushes the pads open, N
    time: float = 0.0

    def motor_force(self) -> np.ndarray:
        return self.servo.force(self.setpoint, self.q, self.v)


@dataclass
class Effect:
    """Does nothing: each effect overrides the hooks it needs. Every parameter's default is its null value.

    Forces on fingers and positions are positive towards open, forces of pads positive when they press.
    """

    rng: np.random.Generator = field(default_factory=np.random.default_rng, init=False, repr=False)

    def start(self, n: int, rng: np.random.Generator) -> None:
        """Before the first step of ``n`` grasps."""
        self.rng = rng

    def send(self, command: np.ndarray, reading: np.ndarray) -> np.ndarray:
        """Once per sample: the command the driver sends, knowing the encoders' readings."""
        return command

    def setpoint(self, setpoint: np.ndarray, s: State) -> np.ndarray:
        """The servo's set point at a physics step."""
        return setpoint

    def motor(self, s: State) -> np.ndarray | float:
        """Further force on the fingers' drives."""
        return 0.0

    def press(self, s: State) -> np.ndarray | float:
        """Further force between pad and object."""
        return 0.0

    def table(self, s: State) -> np.ndarray | float:
        """Further force on the object along y."""
        return 0.0

    def force(self, f: np.ndarray, s: State) -> np.ndarray:
        """The force sensor at a physics step."""
        return f

    def position(self, q: np.ndarray, s: State) -> np.ndarray:
        """The encoder at a sample."""
        return q

    def digitise(self, q: np.ndarray, f: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What is stored of a sample, after noise."""
        return q, f

    def servo(self, servo: Servo) -> Servo:
        """The servo itself."""
        return servo

    def mu(self, friction: float) -> float:
        """The object's friction, on the table and on the pads."""
        return friction

    @property
    def drivetrain(self) -> bool:
        """Whether something gives way between motor and pad, so that :meth:`couple` is needed."""
        return False


class Delay:
    """Gives back what it was given ``delay`` seconds ago, at the physics rate."""

    def __init__(self, delay: float) -> None:
        self._steps, self._past = round(delay / STEP_S), deque()

    def __call__(self, value: np.ndarray) -> np.ndarray:
        self._past.append(value)
        return self._past.popleft() if len(self._past) > self._steps else self._past[0]


class Lag:
    """First-order filter, exact for a held input."""

    def __init__(self, time_constant: float) -> None:
        self._keep = np.exp(-STEP_S / time_constant) if time_constant > 0 else 0.0
        self._state: np.ndarray | None = None

    def __call__(self, value: np.ndarray) -> np.ndarray:
        self._state = value if self._state is None else value + self._keep * (self._state - value)
        return self._state


class DryFriction:
    """A bristle that bends by at most 5 µm, then slips: friction that holds without creeping."""

    BEND_M = 5e-6

    def __init__(self, shape: tuple[int, ...], mass: float) -> None:
        self._bend, self._mass = np.zeros(shape), mass

    def __call__(self, v: np.ndarray, level: np.ndarray | float) -> np.ndarray:
        stiffness = np.max(level) / self.BEND_M
        if stiffness == 0.0:
            return np.zeros_like(self._bend)
        limit = level / stiffness
        bend = np.clip(self._bend + v * STEP_S, -limit, limit)
        damping = 1.4 * np.sqrt(stiffness * self._mass)
        force = stiffness * bend + damping * (bend - self._bend) / STEP_S
        self._bend = bend
        return -np.clip(force, -level, level)
