"""Which b₂ closes as a measured gripper did: least squares on the trajectory of a power grasp."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import RectBivariateSpline
from scipy.optimize import least_squares
from scipy.stats import t as student

from forcegrasp.calibration.power_grasp import speed
from forcegrasp.calibration.rig import FINAL_S, MAX_DELTA_M, SAMPLE_S, close, parameter_of
from forcegrasp.errors import ConfigError, MeasurementError
from forcegrasp.physics.gripper import Gripper
from forcegrasp.physics.gripper_file import default_gripper

# Values of the parameter that are simulated, to interpolate between: 25 of b₂ come within 1 µm of a simulation.
_TABLE = 25
# Largest squeeze: a finger that stops at an object may have touched it this much earlier.
_SQUEEZE_M = 0.004
_LEAST_SAMPLES, _LEAST_WAY_M = 10, 0.006
# How far the first command may be from where the finger seems to have set off, and how long a closing may take.
_SLACK_S, _LONGEST_S = 0.5, 60.0
# Residuals are counted in these, so that the optimiser's tolerances fit: the order of an encoder's noise.
_UNIT_M = 1e-5


@dataclass(frozen=True)
class PowerGraspFit:
    """The parameter whose simulated closing is nearest to a measured one."""

    parameter: str
    value: float
    low: float  #: of its 95 % interval, which is wider where neighbouring residuals are alike
    high: float
    at_bound: bool  #: whether the value ended where the gripper's description ends: then it is no estimate
    start_s: float  #: when the fingers were first commanded, on the measurement's clock
    open_m: float  #: where they stood then
    time_s: np.ndarray  #: of the samples that were used: those before the stop, ``(T,)``
    measured_m: np.ndarray  #: mean of the fingers, ``(T,)``
    fitted_m: np.ndarray  #: ``(T,)``

    @property
    def rms_m(self) -> float:
        """Root mean square of the residuals, metres; far above the encoder's noise, the model lacks something."""
        return float(np.sqrt(np.mean((self.measured_m - self.fitted_m) ** 2)))


def fit_power_grasp(
    time_s: np.ndarray,
    position_m: np.ndarray,
    parameter: str = "velocity_gain",
    *,
    delta_m: float = MAX_DELTA_M,
    start_s: float | None = None,
    period_s: float | None = None,
    gripper: Gripper | None = None,
    tier: str = "reference",
) -> PowerGraspFit:
    """Finds the b₂ with which the simulator closes as a measured gripper did; the paper did so by eye.

    Free closing is all that is compared: samples from 4 mm before the last position on are left out, so that it does
    not matter whether an object or the fingers' own end stopped them. Where the fingers stood and, unless it is given,
    when they were first commanded are fitted, too. The simulator is run once, on a table of values, and interpolated.

    Args:
      time_s: ``(T,)``, rising.
      position_m: one finger ``(T,)``, or both ``(T, 2)``; 0 is closed.
      parameter: what to fit, by its name in the gripper's description, within the bounds given there.
      delta_m: Δq that was commanded again and again, metres.
      start_s: when the first command was sent, if that is known.
      period_s: seconds between two commands; the gripper's by default.
      gripper: the paper's by default.
      tier: physics tier.

    Raises:
      MeasurementError: if the trajectory is none that could be fitted; says why.
      ConfigError: if there is no such parameter, or the start lies outside the measurement.
    """
    gripper = gripper or default_gripper()
    entry = parameter_of(gripper, parameter)
    clock_s, position = _free_closing(time_s, position_m, gripper)
    time = clock_s - clock_s[0]  # a robot's clock may count from 1970, where differences drown in round-off
    if start_s is not None and not -_SLACK_S <= start_s - clock_s[0] < time[-1]:
        raise ConfigError(f"start_s={start_s:g}: must lie in the measurement, before the stop at {clock_s[-1]:g} s")
    begun = _onset(time, position)
    first = begun - _SLACK_S if start_s is None else start_s - clock_s[0]
    took = time[-1] - begun
    period_s = period_s or gripper.period_s
    if not 2 * period_s <= took <= _LONGEST_S:
        raise MeasurementError(
            f"power grasp: it closed within {took:g} s, and must within {2 * period_s:g} to {_LONGEST_S:g} s:"
            " give times in seconds"
        )
    values = np.linspace(entry.low, entry.high, _TABLE)
    closing = close(
        delta_m, max(time[-1] - first + SAMPLE_S, FINAL_S), {parameter: values},
        gripper=gripper, touching=False, tier=tier, period_s=period_s,
    )  # fmt: skip
    way = closing.position_m[:, :1].mean(axis=2) - closing.position_m.mean(axis=2)
    travel = RectBivariateSpline(values, closing.time_s, way)

    def predict(vector: np.ndarray) -> np.ndarray:
        since = time - (vector[2] if start_s is None else first)
        return vector[1] - np.where(since > 0, travel(vector[0], np.maximum(since, 0.0), grid=False), 0.0)

    opened = float(np.median(position[: max(3, len(position) // 50)]))
    low, high = [entry.low, opened - 0.002], [entry.high, opened + 0.002]
    guess = [opened]
    if start_s is None:
        low, high, guess = [*low, first], [*high, begun + _SLACK_S], [*guess, begun]
    vector, error = _least_squares(lambda x: (predict(x) - position) / _UNIT_M, low, high, guess)
    return PowerGraspFit(
        parameter,
        float(vector[0]),
        float(max(vector[0] - error, entry.low)),
        float(min(vector[0] + error, entry.high)),
        bool(min(vector[0] - entry.low, entry.high - vector[0]) < 1e-3 * (entry.high - entry.low)),
        float(clock_s[0] + vector[2] if start_s is None else start_s),
        float(vector[1]),
        clock_s,
        position,
        predict(vector),
    )


def _least_squares(
    residual: Callable[[np.ndarray], np.ndarray], low: list[float], high: list[float], guess: list[float]
) -> tuple[np.ndarray, float]:
    """The best vector, from several values of its first entry, and half of that entry's 95 % interval."""
    found = min(
        (
            least_squares(residual, np.clip([value, *guess], low, high), bounds=(low, high), x_scale="jac")
            for value in np.linspace(low[0], high[0], 5)[1:-1]
        ),
        key=lambda result: result.cost,
    )
    left, freedom = found.fun, max(1, len(found.fun) - len(low))
    variance = np.linalg.pinv(found.jac.T @ found.jac)[0, 0] * (left @ left) / freedom
    # Residuals that come in runs are worth fewer samples: (1 + r) / (1 − r) of a first-order process.
    alike = np.clip(left[1:] @ left[:-1] / max(left @ left, 1e-300), 0.0, 0.99)
    return found.x, float(student.ppf(0.975, freedom) * np.sqrt(variance * (1 + alike) / (1 - alike)))


def _onset(time: np.ndarray, position: np.ndarray) -> float:
    """About when a finger set off: a straight line through the middle of its way, back to where it stood."""
    half = int(np.argmax(position < (position[0] + position[-1]) / 2))
    rate = speed(time, position)
    return float(np.clip(time[half] - (position[0] - position[half]) / rate, time[0], time[half])) if rate else time[0]


def _free_closing(time_s: np.ndarray, position_m: np.ndarray, gripper: Gripper) -> tuple[np.ndarray, np.ndarray]:
    """Samples before the stop, checked; the mean of both fingers. Each ``(T,)``."""
    try:
        time, position = np.asarray(time_s, float), np.asarray(position_m, float)
    except (TypeError, ValueError) as error:
        raise MeasurementError("power grasp: times and positions must be numbers") from error
    position = position[:, None] if position.ndim == 1 else position
    if time.ndim != 1 or position.shape not in ((len(time), 1), (len(time), 2)):
        raise MeasurementError(
            f"power grasp: times have the shape {time.shape}, positions {position.shape}: they must be (T,), and (T,)"
            " or (T, 2)"
        )
    position = position.mean(axis=1)
    if len(time) < _LEAST_SAMPLES:
        raise MeasurementError(f"power grasp: {len(time)} samples; at least {_LEAST_SAMPLES} are needed")
    if not np.isfinite([time, position]).all():
        raise MeasurementError("power grasp: times and positions must be finite: cut out what was not measured")
    if not (np.diff(time) > 0).all():
        row = int(np.flatnonzero(np.diff(time) <= 0)[0]) + 1
        raise MeasurementError(f"power grasp: time must rise from sample to sample; at sample {row} it does not")
    if np.abs(position).max() > 2 * gripper.stroke:
        raise MeasurementError(
            f"power grasp: a finger at {np.abs(position).max():g}, but {gripper.name} opens to {gripper.stroke:g} m:"
            " give metres from closed"
        )
    end = position[-3:].mean()
    way = position[:3].mean() - end
    if way < _LEAST_WAY_M:
        raise MeasurementError(
            f"power grasp: it closed by {1e3 * way:.1f} mm, and must by {1e3 * _LEAST_WAY_M:g} mm; positions fall while"
            " closing"
        )
    free = int(np.argmax(position < end + _SQUEEZE_M))
    if free < _LEAST_SAMPLES:
        raise MeasurementError(
            f"power grasp: {free} samples before the stop; at least {_LEAST_SAMPLES} are needed: sample faster"
        )
    return time[:free], position[:free]
