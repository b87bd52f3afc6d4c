"""Which effects of the catalogue bend the curve of final force over commanded delta, and how; nothing else does.

Two ways to squeeze are known. *Again and again*: the delta is added to the measured position at every control step, as
in the paper, and the motor settles at kp Δq whatever the object. *Once*: one target is held, Δq beyond the surface; the
object's softness then takes its share of Δq. A table does not say which it was. tests/final_force/test_final_force.py
holds this list against simulations of both.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from forcegrasp.effects import catalogue


@dataclass(frozen=True)
class Onset:
    """Where force begins, or how much of it is missing, on one table."""

    travel_m: float
    reading_n: float  #: the same as a force on the reading, slope × travel
    motor_n: float | None  #: the same as a force of the motor, kp × travel; None if kp is not known


@dataclass(frozen=True)
class Cause:
    """How an effect makes a shape, and the parameters at which it makes one of a given size."""

    how: str
    parameters: Callable[[Onset], dict[str, float | None]]


def _none(onset: Onset) -> dict[str, float | None]:
    return {}


_ONSETS = {
    "command_deadband": Cause(
        "deltas within the band of the command in force are dropped (its `held` form)",
        lambda o: {"threshold_m": o.travel_m},
    ),
    "coulomb_friction": Cause("the motor must overcome it first", lambda o: {"force_n": o.motor_n}),
    "friction_asymmetry": Cause("each motor must overcome its own first, one of them more", _none),
    "stiction": Cause("the motor must overcome it first", lambda o: {"breakaway_n": o.motor_n}),
    "presliding": Cause("the motor must overcome it first, bristles and all", lambda o: {"force_n": o.motor_n}),
    "smooth_friction": Cause("the motor creeps against it, and is not there yet when the force is read", _none),
    "smooth_stiction": Cause("the motor creeps against it, and is not there yet when the force is read", _none),
    "return_spring": Cause("a spring that pulls the finger open takes its part of the motor's force", _none),
    "backlash": Cause(
        "half the gap is lost: ahead of the encoder always, behind it if one target was held",
        lambda o: {"gap_m": 2 * o.travel_m},
    ),
    "backlash_asymmetry": Cause("half of each finger's own gap is lost, as with backlash", _none),
    "adhesion": Cause("it pulls on the reading; only if one target was held", _none),
    "force_hysteresis": Cause("half the play's width is missing while loading", lambda o: {"width_n": 2 * o.reading_n}),
    "force_deadzone": Cause(
        "the sensor hides a force of that size (its `subtract` form)", lambda o: {"threshold_n": o.reading_n}
    ),
    "deadzone_asymmetry": Cause("each sensor hides a force of its own, as with force_deadzone", _none),
    "force_drift": Cause("a zero that has fallen by the end of each hold; free-air readings would be negative", _none),
    "force_bias": Cause(
        "a zero that is too low; free-air readings would be negative unless they are cut",
        lambda o: {"left_n": -o.reading_n, "right_n": -o.reading_n},
    ),
    "encoder_bias": Cause(
        "fingers read more open than they are, so that the same target asks for less",
        lambda o: {"left_m": o.travel_m, "right_m": o.travel_m},
    ),
    "encoder_scale": Cause("fingers read more open than they are, the more so the wider they are", _none),
}
_GATES = {
    "command_deadband": Cause(
        "commands within the band are dropped, larger ones pass in full (its `position` form)",
        lambda o: {"threshold_m": o.travel_m},
    ),
    "position_deadband": Cause(
        "the position loop rests within the band, and beyond it acts in full", lambda o: {"band_m": o.travel_m}
    ),
    "force_deadzone": Cause(
        "small readings are dropped, larger ones pass in full (its `gate` form)",
        lambda o: {"threshold_n": o.reading_n},
    ),
}
_PLATEAUS = {
    "force_limit": Cause("the motor gives no more", lambda o: {"force_n": o.motor_n}),
    "force_saturation": Cause("the sensor reads no more", lambda o: {"level_n": o.reading_n}),
}
_OFFSETS = {
    "force_drift": Cause("a zero that has moved by the end of each hold", _none),
    "force_bias": Cause("a zero that is off", lambda o: {"left_n": -o.reading_n, "right_n": -o.reading_n}),
    "encoder_bias": Cause(
        "fingers read more or less open than they are, so that the same target asks for less or more",
        lambda o: {"left_m": o.travel_m, "right_m": o.travel_m},
    ),
}
#: Shape → effect → how. A curved line has no cause in the catalogue that both ways to squeeze would show.
CAUSES: dict[str, dict[str, Cause]] = {
    "dead_zone": _ONSETS,
    "gate": _GATES,
    "plateau": _PLATEAUS,
    "curve": {},
    "bias": _OFFSETS,
}

#: What final forces have no trace of, by effect.
NO_TRACE = "delays, lags, drift within a grasp, hysteresis of unloading, how and when the object moves"

#: Grasps of the menu, with what each would tell about these effects.
MENU = {
    "slow ramp": "friction and stiction show as a finger that lags in free air, a command dead band as stairs",
    "fast step": "delays, lags and rate limits, of which a table has no trace; a force limit slows the finger",
    "pause and reverse": "backlash loses motion at each turn, friction flips its offset, an encoder bias does neither",
    "partial release": "a sensor's dead zone is crossed at one force, a gap at one travel; hysteresis opens a loop",
    "off-centre": "object friction and crosstalk, of which a table has no trace",
    "long hold": "drift and creep against a constant offset; free air before it shows a force bias",
}
_NEXT = {
    "dead_zone": ("pause and reverse", "partial release"),
    "gate": ("slow ramp", "partial release"),
    "plateau": ("slow ramp", "fast step"),
    "bias": ("long hold", "pause and reverse"),
    "curve": ("slow ramp", "partial release"),
}


def causes_of(shapes: Iterable[str]) -> tuple[str, ...]:
    """Effects that make one of these shapes, in the order in which they act."""
    wanted = {effect for shape in shapes for effect in CAUSES[shape]}
    return tuple(name for name in catalogue() if name in wanted)


def grasps_for(shapes: Iterable[str]) -> tuple[str, ...]:
    """Grasps of the menu to record next, the one that tells most first."""
    return tuple(dict.fromkeys(grasp for shape in shapes for grasp in _NEXT[shape]))
