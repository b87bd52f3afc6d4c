"""What a set gives has a tolerance: radii and places of objects are moved within it, as far as the readings ask."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from forcegrasp.identify.fit import Fit, Simulators, fit_once
from forcegrasp.identify.intervals import listed
from forcegrasp.identify.predict import Case, predict
from forcegrasp.identify.problem import Problem
from forcegrasp.identify.target import Target
from forcegrasp.measure.schema import MeasuredGrasp, MeasurementSet
from forcegrasp.replay.replay import Replay

# What is further off than so many standard deviations is no tolerance; what is nearer than this is not told.
_MOST, _TOLD = 3.0, 1.0
#: It is worth a fit if it takes this share off the squares that a fit leaves beyond the noise.
WORTH = 0.5
# Readings bend with the objects' sizes: so many linear steps.
_STEPS = 3


@dataclass(frozen=True)
class Moved:
    """By how much what is given was moved, in metres."""

    radius_m: dict[str, float]  #: by object
    offset_m: dict[str, float]  #: by grasp
    price: float = (
        0.0  #: log-likelihood that it costs: the prior's, and 1 for each number that was fitted (Akaike 1974)
    )

    def put(self, grasp: MeasuredGrasp) -> MeasuredGrasp:
        """A grasp with radius and place moved."""
        radius, offset = grasp.radius_m, grasp.offset_m
        return dataclasses.replace(
            grasp,
            radius_m=None if radius is None else radius + self.radius_m[grasp.object],
            offset_m=None if offset is None else offset + self.offset_m[grasp.name],
        )

    def words(self, measured: MeasurementSet) -> str:
        """What moved by more than its standard deviation."""
        told = [
            f"radius of {name} by {1e3 * move:+.2g} mm"
            for name, move in self.radius_m.items()
            if abs(move) > _TOLD * measured.radius_std_m
        ]
        far = {name: move for name, move in self.offset_m.items() if abs(move) > _TOLD * measured.offset_std_m}
        if far:
            grasps = "grasp" if len(far) == 1 else "grasps"
            told.append(f"place in {grasps} {listed(list(far))} by up to {1e3 * max(map(abs, far.values())):.2g} mm")
        return listed(told or ["nothing by more than its standard deviation"])


def move_given(measured: MeasurementSet, target: Target, fit: Fit, worth: float = WORTH) -> Moved | None:
    """Radii and places as the readings have them; None if that explains little, or takes more than the tolerance.

    Linear steps from a fit, whose parameters follow, with a Gaussian prior of the set's standard deviations on what is
    given.

    Args:
      measured: the set.
      target: its grasps, lined up.
      fit: with radii and places as given.
      worth: least share of the squares beyond the noise that is to be explained.
    """
    objects = list(dict.fromkeys(g.object for g in target.grasps if g.radius_m is not None))
    placed = [g.name for g in target.grasps if g.offset_m is not None]
    deviations = np.r_[np.full(len(objects), measured.radius_std_m), np.full(len(placed), measured.offset_std_m)]
    moves, moved = np.zeros(len(deviations)), Moved({}, {})
    for number in range(_STEPS if len(moves) else 0):
        if number:
            grasps = tuple(moved.put(g) for g in measured.grasps)
            problem = Problem(fit.problem.gripper, grasps, fit.problem.effects)
            moved_target = dataclasses.replace(target, grasps=grasps)
            fit = fit_once(moved_target, problem, Simulators(problem), fit.vector, rounds=1)
        step, left = _step(measured, target, fit, (objects, placed), moves)
        if left > (1 - worth) * (fit.cost - target.readings) and not number:
            return None
        moves = np.clip(moves + step, -_MOST, _MOST)  # the first step may lead too far
        sizes = (moves * deviations).tolist()
        price = float(len(moves) + np.sum(moves**2) / 2)
        moved = Moved(
            dict(zip(objects, sizes[: len(objects)], strict=True)),
            dict(zip(placed, sizes[len(objects) :], strict=True)),
            price,
        )
    return moved if 0 < np.abs(moves).max(initial=0.0) < _MOST else None


def _step(
    measured: MeasurementSet, target: Target, fit: Fit, given: tuple[list[str], list[str]], before: np.ndarray
) -> tuple[np.ndarray, float]:
    """One linear step of what is given, in its standard deviations, and the squares beyond the noise that it leaves.

    Args:
      measured: the set.
      target: its grasps, lined up.
      fit: of the base model.
      given: the objects whose radius is given, and the grasps whose place is.
      before: steps until now, ``(given,)``.
    """
    case, grasps = fit.problem.case(fit.vector), fit.problem.grasps
    deviations = {"radius_m": measured.radius_std_m, "offset_m": measured.offset_std_m}
    cases = [case, *(Case(case.base | {n: case.base[n] + std}, case.effects) for n, std in deviations.items())]
    signals = predict(Replay(fit.problem.gripper, grasps), cases)
    radius, offset = (np.where(target.mask[..., None], (one - signals[0]) / target.sigma, 0.0) for one in signals[1:])
    columns = [radius * np.array([g.object == name for g in grasps])[:, None, None] for name in given[0]]
    columns += [offset * np.array([g.name == name for g in grasps])[:, None, None] for name in given[1]]
    slopes = np.column_stack([fit.jacobian.reshape(-1, len(fit.problem)), *(c.ravel() for c in columns)])
    prior, residual = np.eye(slopes.shape[1])[len(fit.problem) :], fit.residual.ravel()
    step = np.linalg.lstsq(np.vstack([slopes, prior]), np.r_[residual, -before], rcond=None)[0]
    left = float(np.sum((residual - slopes @ step) ** 2)) - target.readings
    return step[len(fit.problem) :], left
