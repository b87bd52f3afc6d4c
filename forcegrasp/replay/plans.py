"""What to command so that the data tell effects apart: a menu of grasps, and plans made of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from forcegrasp.physics.gripper import Gripper
from forcegrasp.physics.sampling import offset_limits_m
from forcegrasp.short_repr import ShortRepr

#: Seconds between two commands of a plan, and the length of a grasp (paper: 25 Hz, 6 s).
PERIOD_S, SAMPLES = 0.04, 150
# Time open and at rest before anything moves, which shows what sensors read in free air. Samples.
_REST = 8


@dataclass(frozen=True, repr=False)
class PlannedGrasp(ShortRepr):
    """A grasp to record: all motors are given the same command, the object may stand off the centre."""

    object: int
    kind: str  #: its name on the menu
    offset_m: float
    command_m: np.ndarray  #: m or rad, ``(SAMPLES, motors)``


# Each grasp on the menu is given as the way from open (1) to first contact (0) and on to the deepest squeeze (−1), at
# times in seconds; the command runs straight between two points, and jumps where two share a time.
Way = list[tuple[float, float]]

MENU: dict[str, Way] = {
    "slow ramp": [(0.6, 1), (1.0, 0.15), (3.4, -1), (4.6, -1), (5.6, 0.2)],
    "fast step": [(0.6, 1), (0.6, 0.08), (1.5, 0.08), (1.5, -1), (3.0, -1), (3.0, -0.4), (4.4, -0.4), (4.4, 1)],
    "pause and reverse": [
        (0.6, 1), (1.4, 0.05), (1.9, -0.35), (2.3, -0.35), (2.5, -0.1), (2.9, -0.1), (3.2, -0.7), (3.6, -0.7),
        (3.8, -0.4), (4.2, -0.4), (4.5, -1), (4.9, -1), (5.2, -0.5), (5.6, -0.5),
    ],
    "partial release": [
        (0.6, 1), (1.2, 0.1), (1.6, -1), (2.2, -1), (2.6, -0.25), (3.0, -0.25), (3.3, -1), (3.7, -1), (4.2, 0.25),
        (4.6, 0.25), (5.0, -0.8),
    ],
    "long hold": [(0.6, 1), (1.0, -0.8), (5.2, -0.8), (5.2, 1)],
    "close and hold": [(0.6, 1), (1.6, 0.1), (2.2, -1)],
}  # fmt: skip
#: The grasp that shows the object move: any way will do, but the object must stand off the centre.
OFF_CENTRE = "off-centre"

#: Plan → grasps on the menu, in turn.
PLANS: dict[str, tuple[str, ...]] = {
    "rich": ("slow ramp", "fast step", "pause and reverse", "partial release", "long hold"),
    "close_and_hold": ("close and hold",),
}


def make_command(
    kind: str, contact: float, stroke: float, squeeze: float, speed: float = 1.0, motors: int = 2
) -> np.ndarray:
    """Commands of a grasp on the menu, m or rad, ``(SAMPLES, motors)``.

    Args:
      kind: its name.
      contact: position of the motors at first contact.
      stroke: their position when open.
      squeeze: deepest command beyond contact.
      speed: stretches the way's pieces; below 1 it is slower and its end is cut off.
      motors: how many are given it.
    """
    way = MENU["slow ramp" if kind == OFF_CENTRE else kind]
    time = np.arange(SAMPLES) * PERIOD_S
    instants = np.array([t for t, _ in way])
    instants = instants[0] + (instants - instants[0]) / speed
    # two points of one time are a jump: the later one counts from that time on
    instants = np.maximum.accumulate(instants + np.arange(len(instants)) * 1e-9)
    place = np.interp(time, instants, [p for _, p in way])
    along = np.where(place >= 0, contact + place * (stroke - contact), contact + place * squeeze)
    along[:_REST] = stroke
    return np.repeat(np.clip(along, 0.0, stroke)[:, None], motors, axis=1)


def make_plan(
    plan: str, radii_m: np.ndarray, grasps: int, gripper: Gripper, rng: np.random.Generator
) -> list[PlannedGrasp]:
    """A plan of grasps: the objects in turn, each meeting the whole menu at several speeds, depths and offsets.

    Args:
      plan: a name out of :data:`PLANS`.
      radii_m: radius of each object, ``(objects,)``.
      grasps: how many.
      gripper: whose motors are commanded.
      rng: draws speeds, depths and offsets.
    """
    deepest, kinds, simple = gripper.stroke / 9, PLANS[plan], plan == "close_and_hold"
    widest = float(gripper.opening.opening_m[-1]) / 2
    planned = []
    for index in range(grasps):
        turn, object_index = divmod(index, len(radii_m))
        radius = radii_m[object_index]
        speed, depth = (1.0, 1.0) if simple else (rng.uniform(0.8, 1.25), rng.uniform(0.5, 1.0))
        room = min(widest - radius, radius / 3, widest / 8)
        off_centre = (turn + object_index) % 2 == 1 and not simple
        offset = rng.uniform(0.3, 0.8) * room * rng.choice([-1, 1]) if off_centre else 0.0
        offset = float(np.clip(offset, *offset_limits_m(gripper, radius, 0.0)))
        kind, contact = kinds[(turn + object_index) % len(kinds)], float(gripper.contact_position(radius))
        command = make_command(kind, contact, gripper.stroke, depth * deepest, speed, len(gripper.motors))
        planned.append(PlannedGrasp(object_index, kind, offset, command))
    return planned
