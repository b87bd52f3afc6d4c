"""Whether the DFKI pendulum's measured torque moves it: friction and offset fitted to windows that are simulated.

    J q'' = τ − m c g sin q − Fv q' − Fc arctan(100 q') − offset

Position and velocity of every window's start are fitted, too.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import savgol_filter

from tools.real_data.dfki_regression import GRAVITY

WINDOW_S = 0.33
_SUBSTEPS, _SHARPNESS = 4, 100.0
#: What a parameter, a start's position and its velocity are counted in.
_FRICTION, _POSITION, _VELOCITY = 0.05, 0.01, 0.3


@dataclass(frozen=True)
class OpenLoop:
    """Friction with which a torque moves the pendulum best.

    Args:
      values: Fv, Fc, offset; N·m·s/rad, N·m, N·m.
      errors: their standard errors, if what is left were white.
      left_rad: root mean square of what is left of the position.
    """

    values: tuple[float, float, float]
    errors: tuple[float, float, float]
    left_rad: float


def fit(time_s: np.ndarray, position: np.ndarray, torque: np.ndarray, inertia: float, mc: float) -> OpenLoop:
    """Fits by least squares.

    Args:
      time_s: instants, evenly spaced, ``(T,)``.
      position: rad, ``(T,)``.
      torque: that acts from each instant to the next, N·m, ``(T,)``.
      inertia: J, kg·m².
      mc: mass times distance of its centre, kg·m.
    """
    period = float(np.mean(np.diff(time_s)))
    length = round(WINDOW_S / period)
    rows = np.arange(0, len(time_s) - length + 1, length) + np.arange(length)[:, None]  # (length, windows)
    smooth = [np.asarray(savgol_filter(position, 31, 3, deriv=k, delta=period))[rows[0]] for k in (0, 1)]
    measured, acting, windows = position[rows], torque[rows], rows.shape[1]

    def residual(guess: np.ndarray) -> np.ndarray:
        viscous, dry, offset = _FRICTION * guess[:3]
        q = smooth[0] + _POSITION * guess[3 : 3 + windows]
        v = smooth[1] + _VELOCITY * guess[3 + windows :]
        left, h = np.empty_like(measured), period / _SUBSTEPS
        for k, now in enumerate(acting):
            left[k] = q - measured[k]
            for _ in range(_SUBSTEPS):
                friction = viscous * v + dry * np.arctan(_SHARPNESS * v) + offset
                v = v + h * (now - mc * GRAVITY * np.sin(q) - friction) / inertia
                q = q + h * v
        return left.ravel()

    found = least_squares(residual, np.zeros(3 + 2 * windows), max_nfev=100)
    left = float(np.sqrt(np.mean(found.fun**2)))
    free = found.fun.size - found.x.size
    covariance = np.linalg.pinv(found.jac.T @ found.jac) * (found.fun @ found.fun) / free
    values, errors = _FRICTION * found.x[:3], _FRICTION * np.sqrt(np.diag(covariance)[:3])
    return OpenLoop(tuple(values.tolist()), tuple(errors.tolist()), left)
