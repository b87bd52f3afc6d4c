"""The staircase: squeeze, note the final force, open, squeeze harder; its slope gives the force scale f_α."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from forcegrasp.calibration.rig import MAX_DELTA_M, Closing, Values, close, column_of
from forcegrasp.calibration.stiffness import RADIUS_M, kappa_values
from forcegrasp.errors import ConfigError, MeasurementError
from forcegrasp.final_force.shapes import BIAS, bootstrap, fit_shape
from forcegrasp.physics.gripper import Gripper
from forcegrasp.physics.gripper_file import default_gripper

#: The paper's commands: from 0.3 mm in steps of 0.3 mm up to Δq_max. Metres.
DELTAS_M = np.arange(1, 11) * MAX_DELTA_M / 10
#: Slopes of the final forces on the robot, N/m (paper, caption of the figure of final forces).
PAPER_SLOPES_N_M = {"sponge": 278.0, "wood": 330.0}
# Fingers start this far from the object: from fully open, 0.3 mm per command takes ten seconds to reach it.
_GAP_M = 0.001
_SEED = 278330


@dataclass(frozen=True)
class Staircase:
    """Final forces of several objects, each squeezed by the same commands."""

    delta_m: np.ndarray  #: Δq, metres, ``(d,)``
    force_n: np.ndarray  #: f(T), newtons, ``(objects, d)``
    position_m: np.ndarray  #: q(T), metres, ``(objects, d)``

    @property
    def slopes(self) -> list[Slope]:
        """The regression of each object."""
        return [regress(self.delta_m, force) for force in self.force_n]


@dataclass(frozen=True)
class Slope:
    """A regression of final force on commanded delta, f(T) = slope · Δq + offset."""

    n_per_m: float
    low: float  #: of the slope's 95 % interval, from resampled residuals
    high: float
    offset_n: float
    rms_n: float


def staircase(
    kappa: Values | None = None,
    *,
    values: Mapping[str, Values] | None = None,
    deltas_m: Values = DELTAS_M,
    seconds: float = 6.0,
    gripper: Gripper | None = None,
    **more,
) -> Staircase:
    """Squeezes each object once per command and notes the final force (paper, appendix).

    All squeezes run at once, each from just before the object: the simulator forgets one when the fingers open.

    Args:
      kappa: softness of the objects, ``(objects,)``.
      values: or the objects' parameters by their names in the gripper's description, each ``(objects,)`` or one value;
        objects have a radius of 25 mm unless it is given.
      deltas_m: Δq, metres, ``(d,)``.
      seconds: how long each squeeze is held.
      gripper: the paper's by default.
      **more: further arguments of :func:`~forcegrasp.calibration.rig.close`.

    Raises:
      ConfigError: unless one of ``kappa`` and ``values`` is given, or if forces have not settled in the end.
    """
    if (kappa is None) == (values is None):
        raise ConfigError("a staircase needs the objects' kappa, or their values, and not both")
    gripper = gripper or default_gripper()
    given = {"radius_m": RADIUS_M} | (dict(values or {}) if kappa is None else kappa_values(kappa))
    columns = {name: column_of(name, value) for name, value in given.items()}
    objects = max(map(len, columns.values()))
    if any(len(column) not in (1, objects) for column in columns.values()):
        counts = ", ".join(f"{name} {len(column)}" for name, column in columns.items() if len(column) > 1)
        raise ConfigError(f"one value each, or as many as there are objects: got {counts}")
    deltas = column_of("deltas_m", deltas_m)
    columns = {name: np.repeat(np.broadcast_to(column, objects), len(deltas)) for name, column in columns.items()}
    near = columns["radius_m"] + np.abs(columns.get("offset_m", 0.0)) + _GAP_M
    closing = close(
        np.tile(deltas, objects),
        seconds,
        columns,
        gripper=gripper,
        start_m=np.clip(near, 0.0, gripper.stroke),
        **more,
    )
    _demand_settled(closing, seconds)
    shape = (objects, len(deltas))
    return Staircase(deltas, closing.final_force_n.reshape(shape), closing.final_position_m.reshape(shape))


def _demand_settled(closing: Closing, seconds: float) -> None:
    final = closing.final_force_n
    earlier = closing.force_n[:, (closing.time_s > 0.8 * seconds) & (closing.time_s < 0.9 * seconds)].mean(axis=(1, 2))
    if not (np.abs(final - earlier) <= 0.05 * np.abs(final)).all() or not (final > 0).all():
        raise ConfigError(f"seconds={seconds:g}: final forces have not settled: hold longer, or command more")


def regress(delta_m: np.ndarray, force_n: np.ndarray) -> Slope:
    """Line with an offset through final forces, as the paper drew it. For more than a line: ``forcegrasp diagnose``.

    Args:
      delta_m: commanded Δq, metres, ``(d,)``.
      force_n: final forces, newtons, ``(d,)``; of the simulator or of a real gripper.

    Raises:
      MeasurementError: if there are fewer than four different deltas, or numbers are missing.
    """
    try:
        x, y = np.asarray(delta_m, float), np.asarray(force_n, float)
    except (TypeError, ValueError) as error:
        raise MeasurementError("final forces: deltas and forces must be numbers") from error
    if x.ndim != 1 or x.shape != y.shape or not (np.isfinite(x).all() and np.isfinite(y).all()):
        raise MeasurementError(f"final forces: {x.shape} deltas and {y.shape} forces must be as many, and finite")
    if len(np.unique(x)) < 4:
        raise MeasurementError(f"final forces: {len(np.unique(x))} different deltas; a slope needs at least 4")
    fit = fit_shape(BIAS, x, y)
    low, high = np.quantile(bootstrap(fit, x, np.random.default_rng(_SEED))[:, 0], (0.025, 0.975))
    return Slope(fit.slope, float(low), float(high), float(fit.values[1]), float(np.sqrt(np.mean(fit.residual**2))))


def match_force_scale(measured_n_m: Values, per_force_scale_n_m: float) -> np.ndarray:
    """f_α with which the simulator's slope is the measured one (paper: "the factor needed to match").

    Args:
      measured_n_m: slope on the robot, N/m.
      per_force_scale_n_m: slope of the simulator at f_α = 1, N/m.
    """
    if not per_force_scale_n_m > 0:
        raise ConfigError(f"per_force_scale_n_m={per_force_scale_n_m:g}: must be positive")
    return np.asarray(measured_n_m, float) / per_force_scale_n_m
