"""The authors' regression of the DFKI pendulum, written again: what their published values come from.

    τ = J q'' + m c g sin q + Fv q' + Fc arctan(100 q') + offset

Filters of simple_pendulum/model/system_identification.py (commit ed17ea2): Butterworth of order 3, forwards and
backwards, at 0.2 of the Nyquist frequency for the measured velocity that q'' is the gradient of, at 0.1 for q'' and τ;
q' is the gradient of q.
"""

from __future__ import annotations

import numpy as np
from scipy.signal import butter, sosfiltfilt

GRAVITY = 9.81
NAMES = ("J", "mc", "Fv", "Fc", "offset")
PUBLISHED = dict(zip(NAMES, (0.06259, 0.1022, 0.04707, 0.1839, -0.07586), strict=True))


def smooth(values: np.ndarray, cutoff: float) -> np.ndarray:
    """Low-passed forwards and backwards, ``cutoff`` as a share of the Nyquist frequency."""
    return sosfiltfilt(butter(3, cutoff, output="sos"), values, padlen=12)  # as long as filtfilt's, which they use


def regress(
    time_s: np.ndarray, position: np.ndarray, velocity: np.ndarray, torque: np.ndarray, sharpness: float = 100.0
) -> dict[str, float]:
    """Parameters by least squares.

    Args:
      time_s: instants, ``(T,)``.
      position: rad.
      velocity: as measured, rad/s.
      torque: as measured, N·m.
      sharpness: of the arctan that stands for the sign of the velocity, s/rad; infinite for the sign itself times π/2.
    """
    speed = np.gradient(position, time_s)
    acceleration = smooth(np.gradient(smooth(velocity, 0.2), time_s), 0.1)
    friction = np.sign(speed) * np.pi / 2 if np.isinf(sharpness) else np.arctan(sharpness * speed)
    columns = np.column_stack([acceleration, GRAVITY * np.sin(position), speed, friction, np.ones_like(speed)])
    found, *_ = np.linalg.lstsq(columns, smooth(torque, 0.1), rcond=None)
    return dict(zip(NAMES, found.tolist(), strict=True))
