"""What a set gives has a tolerance: radii and places of objects are moved within it, as far as the readings ask."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from forcegrasp.identify.fit import Fit
from forcegrasp.identify.intervals import listed
from forcegrasp.identify.predict import Case, predict
from forcegrasp.identify.target import Target
from forcegrasp.measure.schema import MeasuredGrasp, MeasurementSet
from forcegrasp.replay.replay import Replay

# What is further off than so many standard deviations is no tolerance; what is nearer than this is not told.
_MOST, _TOLD = 3.0, 1.0
# It is worth a fit if it takes this share off the squares that a fit leaves beyond the noise.
_WORTH = 0.5


@dataclass(frozen=True)
class Moved:
    """By how much what is given was moved, in metres."""

    radius_m: dict[str, float]  #: by object
    offset_m: dict[str, float]  #: by grasp
    price: float  #: log-likelihood that it costs: the prior's, and 1 for each number that was fitted (Akaike 1974)
    told: tuple[str, ...]  #: what moved by more than its standard deviation, in words

    def put(self, grasp: MeasuredGrasp) -> MeasuredGrasp:
        """A grasp with radius and place moved."""
        radius, offset = grasp.radius_m, grasp.offset_m
        return dataclasses.replace(
            grasp,
            radius_m=None if radius is None else radius + self.radius_m[grasp.object],
            offset_m=None if offset is None else offset + self.offset_m[grasp.name],
        )


def move_given(measured: MeasurementSet, target: Target, fit: Fit) -> Moved | None:
    """Radii and places as the readings have them; None if that explains little, or takes more than the tolerance.

    One linear step from a fit, whose parameters follow, with a Gaussian prior of the set's standard deviations on what
    is given.

    Args:
      measured: the set.
      target: its grasps, lined up.
      fit: of the base model, with radii and places as given.
    """
    case, grasps = fit.problem.case(fit.vector), target.grasps
    deviations = {"radius_m": measured.radius_std_m, "offset_m": measured.offset_std_m}
    moved = [Case(case.base | {name: case.base[name] + std}, case.effects) for name, std in deviations.items()]
    signals = predict(Replay(fit.problem.gripper, grasps), [case, *moved])
    changes = [np.where(target.mask[..., None], (one - signals[0]) / target.sigma, 0.0) for one in signals[1:]]
    of_object = {g.object: np.array([h.object == g.object for h in grasps]) for g in grasps if g.radius_m is not None}
    of_grasp = {g.name: np.array([h is g for h in grasps]) for g in grasps if g.offset_m is not None}
    groups = [(changes[0], rows) for rows in of_object.values()] + [(changes[1], rows) for rows in of_grasp.values()]
    if not groups:
        return None
    fitted = fit.jacobian.reshape(-1, len(fit.problem))
    slopes = np.column_stack([fitted, *((change * rows[:, None, None]).ravel() for change, rows in groups)])
    prior, residual = np.eye(slopes.shape[1])[len(fit.problem) :], fit.residual.ravel()
    step = np.linalg.lstsq(np.vstack([slopes, prior]), np.r_[residual, np.zeros(len(prior))], rcond=None)[0]
    beyond, moves = fit.cost - target.readings, step[len(fit.problem) :]
    taken = fit.cost - float(np.sum((residual - slopes @ step) ** 2))
    if taken < _WORTH * beyond or np.abs(moves).max() > _MOST:
        return None
    radii = dict(zip(of_object, moves[: len(of_object)] * deviations["radius_m"], strict=True))
    offsets = dict(zip(of_grasp, moves[len(of_object) :] * deviations["offset_m"], strict=True))
    told = [f"radius of {name} by {1e3 * radii[name]:+.2g} mm" for name in _far(radii, deviations["radius_m"])]
    if far := _far(offsets, deviations["offset_m"]):
        most = max(abs(offsets[name]) for name in far)
        told.append(f"{listed(['place in grasp ' + name for name in far])} by up to {1e3 * most:.2g} mm")
    return Moved(radii, offsets, float(len(moves) + np.sum(moves**2) / 2), tuple(told))


def _far(moves: dict[str, float], std: float) -> list[str]:
    return [name for name, move in moves.items() if abs(move) > _TOLD * std]
