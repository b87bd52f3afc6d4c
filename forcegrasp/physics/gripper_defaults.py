"""What a training draws where the description of a gripper does not say: it follows from the scene."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from forcegrasp.physics.gripper import Gripper
from forcegrasp.physics.gripper_parts import Training

# Radii, as shares of half the opening: both fingers reach the objects, and they fit in. Deformation of the smallest.
_RADII, _START_RADII, _DEFORMATION = (0.4, 0.75), (0.5, 0.6), 0.4
# Noise of encoders as a share of the stroke, and of force sensors as one of the largest force; a finger counts as
# touching at so many times the noise, and the smallest goal is so many times that.
_POSITION_NOISE, _FORCE_NOISE, _TOUCHING, _SMALLEST_GOAL = 6e-4, 0.02, 4.0, 2.0
# The hand-written controller closes with this share of the largest step: 4 mm of 3 mm in the authors' code.
_CLOSING = 4 / 3


def training_of_scene(gripper: Gripper, given: Mapping[str, Any]) -> Training:
    """What is given, completed.

    Args:
      gripper: whose `training` is not looked at.
      given: entries of :class:`Training` that the description has.
    """
    half = float(gripper.opening.opening_m[-1]) / 2
    force = max_force(gripper)
    values: dict[str, Any] = {
        "radius_m": (_RADII[0] * half, _RADII[1] * half),
        "start_radius_m": (_START_RADII[0] * half, _START_RADII[1] * half),
        "offset_m": (-half, half),
        "start_offset_m": (0.0, 0.0),
        "max_force_n": force,
        "softness": dict[str, tuple[float, float]](),
        "servo_gain": "",
        "servo_gain_range": (0.0, 0.0),
        "position_std": _POSITION_NOISE * gripper.stroke,
        "closing_step": _CLOSING * gripper.max_step,
    } | dict(given)
    values.setdefault("force_std_n", _FORCE_NOISE * values["max_force_n"])
    values.setdefault("contact_threshold_n", _TOUCHING * values["force_std_n"])
    values.setdefault("goal_force_min_n", _SMALLEST_GOAL * values["contact_threshold_n"])
    values.setdefault("deformation_m", _DEFORMATION * values["radius_m"][0])
    # where f = k Δq holds, k of a middling object: the geometric mean of the softest and the hardest
    ends = values["softness"].get("force_scale", (1.0, 1.0))
    stiffness = values["max_force_n"] / gripper.max_step * math.sqrt(abs(ends[0] * ends[1]))
    return Training(**{"assumed_stiffness": stiffness} | values)


def max_force(gripper: Gripper) -> float:
    """Static force of a finger's pads while the command is the largest step beyond its motor's position, newtons."""
    model = gripper.compile()
    drive = model.actuator(gripper.motors[0].actuator)
    slope = sum(t for t, f in zip(gripper.opening.travel, gripper.fingers, strict=True) if f.motor == 0)
    effort = -drive.biasprm[1] * gripper.max_step
    if model.actuator_forcelimited[drive.id]:
        effort = min(effort, float(drive.forcerange[1]))
    return float(effort / slope)
