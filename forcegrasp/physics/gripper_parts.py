"""What a gripper is made of: motors, fingers, what is read and commanded, what a fit or a training may change."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from forcegrasp.short_repr import ShortRepr

#: Of what a base parameter has one value each.
SCOPES = ("gripper", "object", "recording", "grasp")
Softness = TypeVar("Softness", float, np.ndarray)
#: Stroke for which the sizes of effects in the catalogue are typical; metres, or as many radians.
TYPICAL_STROKE = 0.05
#: A grasp's forces, for which they are typical as well, as a multiple of what the largest command step gives: 3 for
#: TIAGo's gripper, 1 to 2 for the other shipped ones.
TYPICAL_FORCE = 2.0
#: Largest command step where a description does not say, as a share of the stroke.
STEP_SHARE = 1 / 15


@dataclass(frozen=True)
class FieldWrite:
    """One column of a per-simulation MuJoCo field that follows a parameter."""

    field: str
    column: int | None
    sign: float
    joint: str = ""  #: of a mechanism: the one joint, or the motor on it, whose field follows; empty for all


@dataclass(frozen=True)
class BaseParameter:
    """What a fit may change about the gripper or an object; never called a missing effect."""

    name: str
    nominal: float
    low: float
    high: float
    unit: str
    scope: str  #: one value for the "gripper", per "object", "recording" or "grasp"
    writes: tuple[FieldWrite, ...]
    times: str = ""  #: setting of a recording that multiplies the value; empty for none

    @property
    def logarithmic(self) -> bool:
        """Whether it is fitted by its logarithm: it is positive and spans more than a factor of 5."""
        return self.low > 0 and self.high / self.low > 5


@dataclass(frozen=True)
class Channel:
    """One number that is commanded or read at every sample."""

    name: str  #: in tables and arrays: position_l, force
    column: str  #: in files: q_l_m, f_n
    unit: str  #: m, rad or N


@dataclass(frozen=True)
class Motor:
    """A position servo, and the joint on which its encoder sits. Its position is 0 closed and grows while opening."""

    actuator: str
    joint: str
    closed: float  #: joint value where the position is 0, m or rad
    open: float
    unit: str  #: of the joint: "m" or "rad"

    @property
    def sign(self) -> float:
        """1 if the joint grows while opening, else −1."""
        return 1.0 if self.open > self.closed else -1.0

    @property
    def stroke(self) -> float:
        """Position when fully open, m or rad."""
        return abs(self.open - self.closed)


@dataclass(frozen=True)
class Finger:
    """One side of the grasp: the body whose geoms, and those of the bodies on it, touch the object."""

    body: str
    joint: str  #: that moves it; empty if it stands still
    motor: int  #: index of the motor that moves it; −1 if it stands still
    force_sensor: str  #: empty if it has none


@dataclass(frozen=True, repr=False)
class Training(ShortRepr):
    """What a training draws and how its sensors are, unless its options say otherwise."""

    radius_m: tuple[float, float]  #: object radii
    start_radius_m: tuple[float, float]  #: the same at the start of the curriculum
    offset_m: tuple[float, float]  #: where objects stand along the grasp axis
    start_offset_m: tuple[float, float]
    deformation_m: float  #: largest deformation of an object, both sides together
    goal_force_min_n: float
    max_force_n: float  #: static force of a finger at the largest command step, before any force scale
    softness: dict[str, tuple[float, float]]  #: parameter → its values at κ = 0 (hard) and κ = 1 (soft); linear between
    servo_gain: str  #: base parameter that is drawn with every grasp; empty if none is
    servo_gain_range: tuple[float, float]
    position_std: float  #: noise of the encoders, unit of the motors
    force_std_n: float
    contact_threshold_n: float  #: force above which a finger counts as touching
    assumed_stiffness: float  #: k of the hand-written controller, N per unit of the motors
    closing_step: float  #: its command step while it closes, unit of the motors

    def summary(self) -> str:
        low, high = self.radius_m
        return f"radii {low:g} to {high:g} m, forces up to {self.max_force_n:g} N"

    def at(self, parameter: str, kappa: Softness) -> Softness:
        """A parameter that follows the softness κ; linear in it, from the smaller of its two values up."""
        hard, soft = self.softness[parameter]
        low, high, share = (hard, soft, kappa) if hard <= soft else (soft, hard, 1 - kappa)
        return low + share * (high - low)

    def kappa_of_force_scale(self, force_scale: np.ndarray | float) -> np.ndarray:
        """Softness κ whose f_α is nearest: the inverse of :meth:`force_scale`, within [0, 1]."""
        hard, soft = self.softness["force_scale"]
        return np.clip(1 - (force_scale - soft) / (hard - soft), 0.0, 1.0)

    @property
    def largest_force_n(self) -> float:
        """Static force of a finger at the largest command step, on the object that it presses hardest."""
        return self.max_force_n * float(np.max(self.force_scale(np.array([0.0, 1.0]))))

    @property
    def ceiling_n(self) -> float:
        """Force above which a policy that was trained with this may close no further: a third above what it reaches."""
        return self.largest_force_n * 4 / 3

    def force_scale(self, kappa: Softness) -> Softness:
        """f_α of an object of softness κ; 1 where it does not depend on it."""
        return self.at("force_scale", kappa) if "force_scale" in self.softness else 1.0 + 0.0 * kappa


#: Of what is not trained on, or not yet known.
NO_TRAINING = Training((0, 0), (0, 0), (0, 0), (0, 0), 0, 0, 0, {}, "", (0, 0), 0, 0, 0, 0, 0)
