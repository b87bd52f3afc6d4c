"""Contact stiffness ∂f/∂q: how force grows with position while pressing, by ρ alone or by κ."""

from __future__ import annotations

import numpy as np

from forcegrasp.calibration.rig import MAX_DELTA_M, Closing, Values, close, column_of
from forcegrasp.errors import ConfigError
from forcegrasp.physics import default_gripper

#: Objects of the figures: the middle of the paper's interval of radii, metres.
RADIUS_M = 0.025
# Shares of the final force between which the slope is taken: the first touch and the settling are left out.
_FROM, _TO = 0.2, 0.8


def vary_rho(
    rho_m: Values, *, force_scale: Values = 1.0, delta_m: Values = MAX_DELTA_M, seconds: float = 2.0, **more
) -> Closing:
    """Presses objects of several impedance widths ρ at one f_α: other slopes, the same final force (paper, appendix).

    Args:
      rho_m: ρ, metres, ``(n,)``; the paper's interval is [0.003, 0.010].
      force_scale: f_α.
      delta_m: Δq, metres.
      seconds: how long, from open.
      **more: further arguments of :func:`~forcegrasp.calibration.rig.close`.
    """
    return close(delta_m, seconds, {"rho_m": rho_m, "force_scale": force_scale, "radius_m": RADIUS_M}, **more)


def vary_kappa(kappa: Values, *, delta_m: Values = MAX_DELTA_M, seconds: float = 2.0, **more) -> Closing:
    """Presses objects of several softness κ, which sets ρ and f_α: other slopes and other final forces (paper).

    Args:
      kappa: κ, ``(n,)``; 0 is hard, 1 soft.
      delta_m: Δq, metres.
      seconds: how long, from open.
      **more: further arguments of :func:`~forcegrasp.calibration.rig.close`.

    Raises:
      ConfigError: if a κ lies outside [0, 1].
    """
    return close(delta_m, seconds, kappa_values(kappa) | {"radius_m": RADIUS_M}, **more)


def kappa_values(kappa: Values) -> dict[str, np.ndarray]:
    """ρ and f_α of softness values, by the names of the gripper's description.

    Raises:
      ConfigError: if a κ lies outside [0, 1].
    """
    kappa = column_of("kappa", kappa)
    if not ((kappa >= 0) & (kappa <= 1)).all():
        raise ConfigError(f"kappa={kappa[~((kappa >= 0) & (kappa <= 1))][0]:g}: must lie in [0, 1]")
    training = default_gripper().training
    return {"rho_m": np.asarray(training.at("rho_m", kappa)), "force_scale": np.asarray(training.force_scale(kappa))}


def contact_slope(closing: Closing) -> np.ndarray:
    """∂f/∂q of each closing while pressing, N/m, ``(n,)``; positive: force grows as the fingers close.

    Regression of force on position, means of both fingers, from 20 % to 80 % of the final force; NaN where nothing
    was touched. It is the slope at the speed at which the fingers arrived: a contact of the engine also damps.
    """
    force, position = closing.force_n.mean(axis=2), closing.position_m.mean(axis=2)
    return np.array([_slope(*row) for row in zip(position, force, closing.final_force_n, strict=True)])


def _slope(position: np.ndarray, force: np.ndarray, final: float) -> float:
    if final <= 0:
        return np.nan
    first, last = int(np.argmax(force > _FROM * final)), int(np.argmax(force > _TO * final))
    pressing = slice(max(first - 1, 0), last + 1)
    return float(-np.polyfit(position[pressing], force[pressing], 1)[0])
