"""Grasps that hold most of the error, and whether they fit as grasps of another object than the set says."""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from forcegrasp.identify.base_fit import Subset
from forcegrasp.identify.cross_validation import normal_equations, rms_of_grasps, step_of
from forcegrasp.identify.fit import Fit
from forcegrasp.identify.predict import predict
from forcegrasp.identify.problem import Problem
from forcegrasp.identify.target import Target
from forcegrasp.measure.schema import MeasuredGrasp
from forcegrasp.replay.replay import Replay

# A grasp is odd if, judged by a fit of the others, its error is so many times their median, and the noise.
_ODD = 4.0
# So many are odd at most, and this share of all; where more are, it is the model.
_MOST, _SHARE = 4, 0.25
# Rounds of leaving out and judging again.
_ROUNDS = 4
# An odd grasp fits as another object's if its error is at most so many times the others' median.
_FITS = 2.0


@dataclass(frozen=True)
class OddGrasp:
    """A grasp that the model of the others misses by far."""

    name: str
    object: str
    error: float  #: rms residual ÷ noise under a fit of the other grasps
    like: str = ""  #: object as which it fits; empty if it fits as none
    error_like: float = np.nan  #: rms residual ÷ noise as that object

    def __str__(self) -> str:
        text = f"grasp {self.name} of {self.object} ({self.error:.1f} × noise"
        return f"{text}; {self.error_like:.1f} as one of {self.like})" if self.like else f"{text})"


@lru_cache(maxsize=1)  # asked where a set is doubted, and again where its search begins
def odd_grasps(target: Target, fit: Fit) -> tuple[OddGrasp, ...]:
    """The few grasps that a fit of all others misses by far; none if there are none, or many.

    Args:
      target: the measurements, of grasps of objects.
      fit: of all of them.
    """
    objects = target.objects
    if target.gripper.is_servo or len(objects) < 2:
        return ()
    errors = rms_of_grasps(fit.residual, target)
    if errors.max() < _ODD:
        return ()
    labels = [grasp.object for grasp in target.grasps]
    count, suspects, usual = max(1, min(_MOST, int(_SHARE * len(errors)))), np.array([], int), 1.0
    problem, vector = fit.problem, fit.vector
    for number in range(_ROUNDS):  # those that the others miss most are left out, and judged again by the others
        before = set(suspects)
        suspects = _suspects(errors, labels, count) if number else _least_trimmed(fit, labels, count)
        if set(suspects) == before:  # as if there are none
            break
        rest = np.setdiff1d(np.arange(len(errors)), suspects)
        others = Subset(target, rest, fit)
        problem, vector = others.problem, others.fit(coordinates_by_name(others.problem, (problem, vector))).vector
        errors = errors_as(target, np.arange(len(errors)), target.grasps, problem, vector)
        usual = max(1.0, float(np.median(errors[rest])))
    if not suspects.size:
        return ()
    alone = [target.grasps[i] for i in suspects]
    as_said = errors[suspects]
    odd = [k for k in range(len(suspects)) if as_said[k] > _ODD * usual]
    if not odd:
        return ()
    best: dict[int, tuple[float, str]] = {}
    for name in objects:
        pattern = next(grasp for i, grasp in enumerate(target.grasps) if grasp.object == name and i not in suspects)
        relabelled = [
            dataclasses.replace(g, object=name, radius_m=pattern.radius_m, mass_kg=pattern.mass_kg) for g in alone
        ]
        for k, error in enumerate(errors_as(target, suspects, relabelled, problem, vector)):
            if name != alone[k].object and error < best.get(k, (np.inf, ""))[0]:
                best[k] = (float(error), name)
    found = []
    for k in odd:
        error, like = best[k]
        fits = error <= _FITS * usual
        found.append(OddGrasp(alone[k].name, alone[k].object, float(as_said[k]), like if fits else "", error))
    return tuple(found)


def _suspects(errors: np.ndarray, labels: Sequence[str], count: int) -> np.ndarray:
    """Indices of the grasps of the largest errors."""
    return _left_out(labels, count, lambda index, _: -errors[index])


def _least_trimmed(fit: Fit, labels: Sequence[str], count: int) -> np.ndarray:
    """Indices of the grasps without which the others leave least, as far as slopes tell, one after the other.

    A grasp of a hard object among those of a soft one draws the fit to itself, so that the others seem odd (least
    trimmed squares: Rousseeuw 1984).
    """
    inner, slope = normal_equations(fit)
    squares = np.sum((fit.weight * fit.residual) ** 2, axis=(1, 2))

    def left_by_others(index: int, chosen: Sequence[int]) -> float:
        rest = np.setdiff1d(np.arange(len(squares)), [*chosen, index])
        products, along = inner[rest].sum(axis=0), slope[rest].sum(axis=0)
        step = step_of(fit, products, along)
        return float(squares[rest].sum() - 2 * along @ step + step @ products @ step)

    return _left_out(labels, count, left_by_others)


def _left_out(labels: Sequence[str], count: int, cost: Callable[[int, Sequence[int]], float]) -> np.ndarray:
    """Indices of the grasps of the least cost, ``cost(index, chosen before)``, one after the other.

    Without the last one of an object: nothing else is known of it.
    """
    left, chosen = Counter(labels), list[int]()
    while len(chosen) < count:
        may_go = [i for i, label in enumerate(labels) if i not in chosen and left[label] > 1]
        if not may_go:
            break
        chosen.append(min(may_go, key=lambda index: cost(index, chosen)))
        left[labels[chosen[-1]]] -= 1
    return np.array(chosen, int)


def coordinates_by_name(problem: Problem, known: tuple[Problem, np.ndarray]) -> np.ndarray:
    """A problem's coordinates, as far as another one has them by name."""
    values = {entry.name: x for entry, x in zip(known[0].entries, known[1], strict=True)}
    return np.array([values.get(entry.name, x) for entry, x in zip(problem.entries, problem.start(), strict=True)])


def errors_as(
    target: Target, which: np.ndarray, grasps: Sequence[MeasuredGrasp], problem: Problem, vector: np.ndarray
) -> np.ndarray:
    """Errors of these grasps, with labels of their own, under parameters of the others."""
    own = Problem(problem.gripper, grasps, problem.effects)
    few = target.subset(which)
    case = own.case(coordinates_by_name(own, (problem, vector)))
    return rms_of_grasps(few.residual(predict(Replay(problem.gripper, grasps), [case])[0]), few)
