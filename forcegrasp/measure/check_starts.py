"""Does every grasp begin before its fingers touch?"""

from __future__ import annotations

import numpy as np

from forcegrasp.measure.check_liveness import force_noise, zero_force
from forcegrasp.measure.check_signs import PadsAt
from forcegrasp.measure.samples import place
from forcegrasp.measure.schema import MeasuredGrasp, MeasurementSet

# A force that a grasp begins with is no zero that is off if it is so many times its noise and this share of the largest
# one, and pads stand no further apart than the object is wide, but for this share of what fits between them.
_NOISE, _LARGE, _NEAR = 8.0, 0.1, 0.02


def check_starts(measured: MeasurementSet, pads_at: PadsAt, half_opening_m: float) -> list[str]:
    """Returns a warning if grasps begin pressed: the model's fingers start at rest, and the object stands free.

    Args:
      measured: grasps of a gripper that feels with its fingers, one of them at least.
      pads_at: from positions of the motors to where the pads stand; None where that is not known.
      half_opening_m: half of what fits between the pads.
    """
    largest = max(float(np.quantile(grasp.force_n, 0.98)) for grasp in measured.grasps)
    begun = [one for grasp in measured.grasps if (one := _pressed(grasp, measured, largest, pads_at, half_opening_m))]
    if not begun:
        return []
    grasp, channel, force = begun[0]
    others = f", as {len(begun) - 1} more do" if len(begun) > 1 else ""
    return [
        f"{place(measured.path, grasp, 0, measured.columns.force[channel])}: begins with {force:.3g} N, the fingers"
        f" being on the object{others}; begin a grasp's log before they move, for the model's start at rest and free"
    ]


def _pressed(
    grasp: MeasuredGrasp, measured: MeasurementSet, largest: float, pads_at: PadsAt, half_opening_m: float
) -> tuple[MeasuredGrasp, int, float] | None:
    """The grasp, the channel that reads most as it begins, and how much, newtons; None if it begins free."""
    pads = pads_at(grasp.position_m[:1])
    if pads is None or grasp.radius_m is None or not np.isfinite(half_opening_m):
        return None
    zeros = zero_force(grasp.time_s, grasp.force_n)
    channel = int(zeros.argmax())
    least = max(_LARGE * largest, _NOISE * force_noise(grasp.force_n[:, channel], measured.force_std_n))
    near = float(pads[0].sum()) < 2 * grasp.radius_m + _NEAR * 2 * half_opening_m
    return (grasp, channel, float(zeros[channel])) if near and zeros[channel] > least else None
