"""The error that even a perfect model leaves, and whether there is more."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from forcegrasp.identify.cross_validation import rms
from forcegrasp.identify.fit import Fit
from forcegrasp.identify.predict import predict
from forcegrasp.identify.target import Target
from forcegrasp.replay.replay import Replay

#: Error ÷ floor up to which a model is as good as the data can tell.
AT_FLOOR = 1.03
# Room for what the estimate of the floor misses: in all, and in a single signal and phase.
_ROOM, _ROOM_IN_CELL = 1.03, 1.15
# And for chance: so many standard errors of the rms of white noise.
_CHANCE = 4.0
# A residual beyond this many σ, and three times the numerical error there, is no noise; a few outliers are allowed.
_OUTLIER, _MAX_OUTLIERS = 5.0, 3
# Cells with fewer samples say nothing.
_LEAST_SAMPLES = 40


def numerical_error(fit: Fit, target: Target) -> tuple[np.ndarray, ...]:
    """How far the prediction moves with half the physics step, and with the other collision code, ÷ noise.

    Of parts of recordings also with another position and with another velocity at the start, for these are measured.
    Each ``(G, S, C)``. The fit must be one of the model itself, no rough one. A scene that steps at the control period
    samples as its drive does: with half a step it would be another drive, and no finer simulation of the same one.
    """
    gripper, grasps, case = fit.problem.gripper, fit.problem.grasps, [fit.problem.case(fit.vector)]
    others = (
        Replay(gripper, grasps, step_factor=1.0 if gripper.steps_as_its_drive else 0.5, strict=True),
        Replay(gripper, grasps, other_collisions=True, strict=True),
    )
    if any(grasp.start_std is not None for grasp in grasps):
        others += tuple(Replay(gripper, grasps, start_off=off, strict=True) for off in ((1.0, 0.0), (0.0, 1.0)))
    return tuple(target.change(predict(o, case)[0], fit.predicted) for o in others)


def beyond_fit(fit: Fit, numerical: Sequence[np.ndarray]) -> tuple[np.ndarray, ...]:
    """What of the numerical errors no fitted parameter makes up for, each ``(G, S, C)``."""
    left = []
    for one in numerical:
        shift = np.linalg.lstsq(fit.slopes, fit.weighted(one), rcond=None)[0]
        left.append(one - fit.jacobian @ shift)
    return tuple(left)


def numerical_floor(
    numerical: Sequence[np.ndarray],
    target: Target,
    where: np.ndarray | None = None,
    tolerated: np.ndarray | None = None,
) -> float:
    """rms residual ÷ noise that sensor noise and the model's own numerical error leave.

    Args:
      numerical: from :func:`beyond_fit`, each ``(G, S, C)``.
      target: the measurements.
      where: choice of samples and signals, ``(G, S, C)``.
      tolerated: what the model may be off by besides, ÷ noise, ``(G, S, C)``.
    """
    half, *others = (rms(n, target, where) for n in numerical)
    besides = 0.0 if tolerated is None else rms(tolerated, target, where)
    # Halving the step shows about half of what the step costs in all.
    return float(np.sqrt(1 + 4 * half**2 + np.sum(np.square(others)) + besides**2))


def at_floor(error: float, floor: float) -> bool:
    """Whether a model is as good as the data can tell."""
    return error <= most_at_floor(floor)


def most_at_floor(floor: float) -> float:
    """The largest error ÷ noise of a model that is as good as the data can tell."""
    return max(floor, 1.02) * AT_FLOOR


def excess(
    residual: np.ndarray, numerical: Sequence[np.ndarray], target: Target, tolerated: np.ndarray | None = None
) -> str:
    """Where residuals show more than sensor noise and numerical error; empty if nowhere.

    Args:
      residual: in units of the noise, ``(G, S, C)``.
      numerical, target, tolerated: as for :func:`numerical_floor`.
    """
    off = 2 * np.abs(numerical[0]) + np.abs(numerical[1:]).sum(axis=0) + (0.0 if tolerated is None else tolerated)
    far = np.abs(residual) > _OUTLIER + 3 * off
    few = far.sum() <= max(_MAX_OUTLIERS, 2e-4 * target.readings)
    if few:  # squared, a single one of them may outweigh a thousand others
        residual = np.where(far, np.nan, residual)
    error, floor = rms(residual, target), numerical_floor(numerical, target, tolerated=tolerated)
    if error > floor * max(_ROOM, _by_chance(residual, target)):
        return f"{error:.2f} × noise in all, {floor:.2f} is the floor"
    for name, where in cells(target):
        error, floor = rms(residual, target, where), numerical_floor(numerical, target, where, tolerated)
        if error > floor * max(_ROOM_IN_CELL, _by_chance(residual, target, where)):
            return f"{name}: {error:.2f} × noise, {floor:.2f} is the floor"
    return "" if few else f"{far.sum()} readings are more than {_OUTLIER:g} σ off"


def _by_chance(residual: np.ndarray, target: Target, where: np.ndarray | bool = True) -> float:
    """How many times its expectation the rms of so few readings of noise may be; ``where`` is ``(G, S, C)``."""
    readings = np.sum(target.mask[..., None] & target.is_new & np.isfinite(residual) & where)
    return 1 + _CHANCE / np.sqrt(2 * max(readings, 1))


def cells(target: Target) -> list[tuple[str, np.ndarray]]:
    """Positions and forces in each phase that has samples enough: name and mask ``(G, S, C)``."""
    found = []
    for index, phase in enumerate(target.phases):
        inside = target.phase == index
        if inside.sum() >= _LEAST_SAMPLES:
            for kind, part in target.axis.kinds.items():
                where = np.zeros(target.signals.shape, bool)
                where[..., part] = inside[:, :, None]
                found.append((f"{kind}s, {phase.replace('_', ' ')}", where))
    return found
