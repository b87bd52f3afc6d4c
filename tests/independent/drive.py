"""Effects between the command and the pad."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .effect import Delay, DryFriction, Effect, Lag, State
from .scene import FINGER_KG, MOTOR_LIMIT_N, ROTOR_KG, STEP_S, Servo

_MOVING_KG = FINGER_KG + ROTOR_KG


@dataclass
class CommandDelay(Effect):
    """The bus and the driver's loop: a set point takes effect later, in full."""

    latency: float = 0.0  # s

    def start(self, n, rng):
        self._delay = Delay(self.latency)

    def setpoint(self, setpoint, s):
        return self._delay(setpoint)


@dataclass
class CommandDeadband(Effect):
    """TIAGo's driver: no command is sent to a finger that is, by its encoder, within the band of it.

    The finger then keeps the set point it was last sent.
    """

    band: float = 0.0  # m

    def start(self, n, rng):
        self._sent = None

    def send(self, command, reading):
        if self._sent is None:
            self._sent = command.copy()
        if self.band > 0:
            command = np.where(np.abs(command - reading) > self.band, command, self._sent)
        self._sent = command
        return command


@dataclass
class RateLimit(Effect):
    """The driver moves the set point towards the command at a limited speed."""

    speed: float = np.inf  # m/s

    def start(self, n, rng):
        self._at = None

    def setpoint(self, setpoint, s):
        reach = self.speed * STEP_S
        self._at = setpoint if self._at is None else np.clip(setpoint, self._at - reach, self._at + reach)
        return self._at


@dataclass
class CoulombFriction(Effect):
    """Dry friction of the finger's guide."""

    level: float = 0.0  # N

    def start(self, n, rng):
        self._friction = DryFriction((n, 2), _MOVING_KG)

    def motor(self, s):
        return self._friction(s.v, self.level)


@dataclass
class StaleVelocity(Effect):
    """The drive's speed is how far the encoder came in the last ``window``, and damps by that."""

    window: float = 0.0  # s

    def start(self, n, rng):
        self._delay = Delay(self.window)

    def motor(self, s):
        if self.window == 0:
            return 0.0
        return s.servo.b2 * ((s.q - self._delay(s.q)) / self.window - s.v)


@dataclass
class Stiction(Effect):
    """Dry friction that is stronger at rest: it falls from ``breakaway`` to ``sliding`` within ``stribeck`` m/s."""

    breakaway: float = 0.0  # N
    sliding: float = 0.0  # N
    stribeck: float = 0.002  # m/s

    def start(self, n, rng):
        self._friction = DryFriction((n, 2), _MOVING_KG)

    def motor(self, s):
        level = self.sliding + (self.breakaway - self.sliding) * np.exp(-((s.v / self.stribeck) ** 2))
        return self._friction(s.v, level)


@dataclass
class LoadFriction(Effect):
    """Gears rub by a share of what they carry: the motor's force on one side, the pad's on the other."""

    coefficient: float = 0.0

    def start(self, n, rng):
        self._friction = DryFriction((n, 2), _MOVING_KG)

    def motor(self, s):
        return self._friction(s.v, self.coefficient * np.abs(s.motor_force() - s.load))


@dataclass
class Presliding(Effect):
    """LuGre's bristles without a Stribeck curve: they bend by about ``slip`` before they slide."""

    level: float = 0.0  # N
    slip: float = 2e-4  # m
    relaxation: float = 0.004  # s, of the bristles' own damping

    def start(self, n, rng):
        self._bend = np.zeros((n, 2))

    def motor(self, s):
        rate = s.v - np.abs(s.v) * self._bend / self.slip
        force = self.level / self.slip * (self._bend + self.relaxation * rate)
        self._bend = self._bend + STEP_S * rate
        return -force


@dataclass
class DirectionFriction(Effect):
    """Viscous drag that differs: ``excess`` more while opening; while closing, if it is negative."""

    excess: float = 0.0  # N s/m

    def motor(self, s):
        return -abs(self.excess) * (np.maximum(s.v, 0.0) if self.excess > 0 else np.minimum(s.v, 0.0))


@dataclass
class PositionDeadband(Effect):
    """The servo's loop rests within the band; its damping stays."""

    band: float = 0.0  # m

    def motor(self, s):
        error = s.setpoint - s.q
        without = s.servo.force(s.q, s.q, s.v)
        return np.where(np.abs(error) <= self.band, without - s.motor_force(), 0.0)


@dataclass
class BackEmf(Effect):
    """A supply that gives out: the force at its voltage limit falls with the speed in the force's direction."""

    stall: float = np.inf  # N
    no_load: float = 0.03  # m/s

    def motor(self, s):
        if np.isinf(self.stall):
            return 0.0
        force, voltage_drop = s.motor_force(), self.stall * s.v / self.no_load
        return np.minimum(np.maximum(force, -self.stall - voltage_drop), self.stall - voltage_drop) - force


@dataclass
class SwingingLoad(Effect):
    """A mass that hangs on the drive by a spring, behind the encoder."""

    share: float = 0.0  # of the drive's own mass
    frequency: float = 6.0  # Hz
    damping_ratio: float = 0.1

    def start(self, n, rng):
        self._x = self._v = None

    def motor(self, s):
        if self._x is None:
            self._x, self._v = s.q.copy(), s.v.copy()
        omega = 2 * np.pi * self.frequency
        pull = omega**2 * (self._x - s.q) + 2 * self.damping_ratio * omega * (self._v - s.v)
        self._v = self._v - STEP_S * pull
        self._x = self._x + STEP_S * self._v
        return self.share * _MOVING_KG * pull


@dataclass
class MotorOffset(Effect):
    """The amplifiers' zeros, each motor's own: a force that is always there."""

    left: float = 0.0  # N
    right: float = 0.0  # N

    def motor(self, s):
        return np.broadcast_to([self.left, self.right], s.q.shape)


@dataclass
class ActuatorLag(Effect):
    """The driver's set point filter, first order."""

    time_constant: float = 0.0  # s

    def start(self, n, rng):
        self._lag = Lag(self.time_constant)

    def setpoint(self, setpoint, s):
        return self._lag(setpoint)


@dataclass
class ForceLimit(Effect):
    """A current limit: motor force, damping term included, saturates."""

    limit: float = MOTOR_LIMIT_N  # N

    def servo(self, servo: Servo) -> Servo:
        return replace(servo, limit=self.limit)


@dataclass
class Drivetrain(Effect):
    """Something gives way between the motor, which carries the encoder, and the pad."""

    motor_kg = ROTOR_KG
    guide_on_motor = 0.0  # viscous damping that acts on the motor's side, N s/m

    def couple(self, s: State, pad: np.ndarray, pad_v: np.ndarray, load: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Forces on the pads' bodies and on the motors; ``load`` is what pushes the pads open."""
        raise NotImplementedError


@dataclass
class FingerCompliance(Drivetrain):
    """A bending finger: spring and little damping between motor and pad."""

    compliance: float = 0.0  # m/N
    damping_ratio: float = 0.3

    @property
    def drivetrain(self):
        return self.compliance > 0

    def couple(self, s, pad, pad_v, load):
        damping = 2 * self.damping_ratio * np.sqrt(FINGER_KG / self.compliance)
        force = (s.q - pad) / self.compliance + damping * (s.v - pad_v)
        return force, -force


@dataclass
class Backlash(Drivetrain):
    """Play between motor and pad: after each reversal the motor moves by twice ``gap`` before the pad follows.

    The guide holds the pad while the motor crosses the play, and hands the load on to the motor: so the play is the
    same under any load.
    """

    gap: float = 0.0  # m, half of the play
    motor_kg = _MOVING_KG
    guide_on_motor = 1.0

    @property
    def drivetrain(self):
        return self.gap > 0

    def start(self, n, rng):
        self._pad = None

    def couple(self, s, pad, pad_v, load):
        before = pad if self._pad is None else self._pad
        self._pad = np.clip(before, s.q - self.gap, s.q + self.gap)
        stiffness = 2e4
        damping = 1.4 * np.sqrt(stiffness * FINGER_KG)
        return stiffness * (self._pad - pad) + damping * ((self._pad - before) / STEP_S - pad_v), load


@dataclass
class LooseBacklash(Drivetrain):
    """Another reading: the pad floats freely within the play, held by a little friction, and knocks at its ends."""

    gap: float = 0.0  # m, half of the play
    friction: float = 0.005  # N
    grease: float = 0.2  # N s/m, between the sides

    @property
    def drivetrain(self):
        return self.gap > 0

    def start(self, n, rng):
        self._friction = DryFriction((n, 2), FINGER_KG)

    def couple(self, s, pad, pad_v, load):
        apart, speed = s.q - pad, s.v - pad_v
        beyond = apart - np.clip(apart, -self.gap, self.gap)
        stiffness = 1e4
        knock = stiffness * beyond + np.where(beyond != 0, 0.6 * np.sqrt(stiffness * FINGER_KG) * speed, 0.0)
        # A joint may push but not stick: no pull while the sides separate.
        knock = np.where(knock * beyond > 0, knock, 0.0) + self.grease * speed
        return knock + self._friction(pad_v, self.friction), -knock


@dataclass
class FingerEncoderBacklash(LooseBacklash):
    """The same with the encoder at the pad, by which the servo goes; it still damps by the motor's own speed."""

    def start(self, n, rng):
        super().start(n, rng)
        self._ahead = np.zeros((n, 2))

    def couple(self, s, pad, pad_v, load):
        on_pad, on_motor = super().couple(s, pad, pad_v, load)
        self._ahead = s.q - pad + STEP_S * (s.v - pad_v)
        return on_pad, on_motor

    def setpoint(self, setpoint, s):
        return setpoint + self._ahead

    def position(self, q, s):
        return q - self._ahead
