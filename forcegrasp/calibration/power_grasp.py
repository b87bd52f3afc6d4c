"""Power grasps: how fast the fingers close at full action, by a parameter of the drive such as b₂."""

from __future__ import annotations

import numpy as np

from forcegrasp.calibration.rig import MAX_DELTA_M, Closing, Values, close

#: The paper's b₂, from slow to fast: both ends of its interval, and what mirrors the robot best in between.
PAPER_B2 = (-13.0, -9.0, -6.0)


def power_grasps(
    values: Values = PAPER_B2,
    parameter: str = "velocity_gain",
    *,
    radius_m: float | None = None,
    delta_m: float = MAX_DELTA_M,
    seconds: float = 2.6,
    **more,
) -> Closing:
    """Closes as fast as the controller may, from open, for several values of a parameter of the drive (paper, b₂).

    Args:
      values: of the parameter, ``(n,)``.
      parameter: its name in the gripper's description; ``velocity_gain`` is the paper's b₂, in N·s/m.
      radius_m: radius of an object in the middle of the grasp; none by default.
      delta_m: Δq, metres.
      seconds: how long.
      **more: further arguments of :func:`~forcegrasp.calibration.rig.close`.
    """
    given = {parameter: values} | ({} if radius_m is None else {"radius_m": radius_m})
    return close(delta_m, seconds, given, touching=radius_m is not None, **more)


def closing_speed(closing: Closing) -> np.ndarray:
    """Speed of both fingers over the middle half of their way, by regression, m/s, ``(n,)``; positive closes."""
    return np.array([speed(closing.time_s, position.mean(axis=1)) for position in closing.position_m])


def speed(time: np.ndarray, position: np.ndarray) -> float:
    """Speed of one trajectory ``(T,)`` over the middle half of its way, m/s; 0 if it has none."""
    start, way = position[0], position[0] - position.min()
    middle = (position < start - way / 4) & (position > start - 3 * way / 4)
    if way <= 0 or middle.sum() < 2:
        return 0.0
    return float(-np.polyfit(time[middle], position[middle], 1)[0])
