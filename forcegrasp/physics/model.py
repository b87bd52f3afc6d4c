"""TIAGo's scene, compiled."""

from __future__ import annotations

import mujoco

from forcegrasp.physics.gripper import load_gripper

#: Seconds between two commands: 25 Hz (paper, Sec. 3).
CONTROL_PERIOD_S = 0.04


def build_model(tier: str) -> mujoco.MjModel:
    """Returns the compiled scene of one grasp, see :meth:`~forcegrasp.physics.gripper.Gripper.compile`."""
    return load_gripper("tiago").compile(tier)
