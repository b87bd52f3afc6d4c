"""Fits parameters to measured grasps by bounded least squares, residuals divided by the sensor noise."""

from __future__ import annotations

import contextlib
import dataclasses
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from forcegrasp.effects.setting import EffectSetting
from forcegrasp.identify.local_slopes import LocalSlopes
from forcegrasp.identify.predict import predict
from forcegrasp.identify.priors import with_rows
from forcegrasp.identify.problem import Problem
from forcegrasp.identify.progress import Progress, silent
from forcegrasp.identify.simulators import STEP, Simulators
from forcegrasp.identify.target import Target
from forcegrasp.short_repr import ShortRepr, counted

# Relative change of the cost at which a fit ends, one that only ranks, and the most evaluations until then.
_TOLERANCE, _ROUGH, _EVALUATIONS = 1e-4, 1e-3, 15
# A step that makes the cost rise by this share of what one reading costs ends a fit, or one as small as this, in
# coordinates, or so many one after the other: that contacts are rough is all they say.
_FLAT, _SMALLEST_STEP, _FAILED = 0.1, STEP / 20, 2
# With patience it goes on by so many steps, each a quarter as long, and so many evaluations.
_PATIENCE, _AT_MOST = 8, 40
# Where a fit ended it goes on if slopes measured there promise to lower the cost by this share of one reading's; but
# not so many times the noise off, where the model is wrong by more than that.
_WORTH, _NEAR = 0.5, 2.0


@dataclass(frozen=True, eq=False, repr=False)
class Fit(ShortRepr):
    """Fitted parameters with all that an evidence needs. N residuals (G · S · C), p entries."""

    problem: Problem
    vector: np.ndarray  #: the problem's coordinates, ``(p,)``
    predicted: np.ndarray  #: signals, ``(G, S, C)``
    residual: np.ndarray  #: (measured − predicted) ÷ noise, ``(G, S, C)``
    jacobian: np.ndarray  #: d predicted ÷ noise over coordinates, ``(G, S, C, p)``
    correction: np.ndarray  #: exact minus cheap prediction, ``(G, S, C)``
    gradient: float  #: largest |slope| of the cost along one coordinate, in its own standard error; 0 at an optimum
    evaluations: int
    weight: np.ndarray  #: by which residuals count, ``(G, 1, 1)``

    def summary(self) -> str:
        return f"{counted(len(self.vector), 'parameter')}, sum of squared residuals {self.cost:.4g}"

    @property
    def cost(self) -> float:
        """Weighted sum of squared residuals, in units of the noise, and of what its priors are missed by."""
        return float(np.sum((self.weight * self.residual) ** 2)) + self.problem.priors.cost(self.vector)

    @property
    def left(self) -> np.ndarray:
        """Weighted residuals, and by how many standard deviations priors are missed, ``(N + priors,)``."""
        return self.problem.priors.beside(self.weight * self.residual, self.vector)

    def weighted(self, change: np.ndarray) -> np.ndarray:
        """A change of the signals ÷ noise, ``(G, S, C)``, as it counts, with zeros for priors, ``(N + priors,)``."""
        return with_rows((self.weight * change).ravel(), change.size + len(self.problem.priors))

    @property
    def values(self) -> np.ndarray:
        """Parameters in their own units, ``(p,)``."""
        return self.problem.values(self.vector)

    @property
    def effects(self) -> tuple[EffectSetting, ...]:
        """The effects of the model as they were fitted."""
        return self.problem.case(self.vector).effects

    def effect(self, name: str) -> EffectSetting:
        """The effect of this name as it was fitted."""
        return next(one for one in self.effects if one.effect.name == name)

    @property
    def slopes(self) -> np.ndarray:
        """The weighted Jacobian, and that of the priors, ``(N + priors, p)``."""
        return self.problem.priors.below((self.weight[..., None] * self.jacobian).reshape(-1, len(self.problem)))

    def subset(self, keep: np.ndarray) -> Fit:
        """What it says of the grasps of these indices, without the parameters that none of them follows."""
        old = self.problem
        problem = Problem(old.gripper, [old.grasps[i] for i in keep], old.effects)
        places, samples = _places(old, problem), max(len(g.time_s) for g in problem.grasps)
        return dataclasses.replace(
            self,
            problem=problem,
            vector=self.vector[places],
            predicted=self.predicted[keep][:, :samples],
            residual=self.residual[keep][:, :samples],
            jacobian=self.jacobian[keep][:, :samples][..., places],
            correction=self.correction[keep][:, :samples],
            weight=self.weight[keep],
        )

    def moved(self, part: Problem, coordinates: np.ndarray) -> np.ndarray:
        """Its coordinates, ``(p,)``, but those of a problem of some of its grasps as they are given."""
        vector = self.vector.copy()
        vector[_places(self.problem, part)] = coordinates
        return vector

    def covariance(self) -> np.ndarray:
        """Covariance of the coordinates, ``(p, p)``, if the noise is white; see :mod:`.intervals`."""
        slopes = self.slopes
        norms = np.linalg.norm(slopes, axis=0)
        norms[norms == 0] = np.inf  # no slope tells of what jumps, nor does it move with anything
        alike = slopes / norms  # what data hardly fix has slopes so small that they would pass for none
        return np.linalg.pinv(alike.T @ alike, rcond=1e-12) / np.outer(norms, norms)


def _places(whole: Problem, part: Problem) -> list[int]:
    """Where the entries of a problem of some of its grasps stand among those of a problem of all."""
    names = [entry.name for entry in whole.entries]
    return [names.index(entry.name) for entry in part.entries]


def fit_once(
    target: Target,
    problem: Problem,
    simulators: Simulators,
    start: np.ndarray,
    correction: np.ndarray | float | None = None,
    rounds: int = 2,
    free: np.ndarray | None = None,
    known_slopes: np.ndarray | None = None,
    slopes: np.ndarray | None = None,
    at_the_end: bool = True,
) -> Fit:
    """Fits from one start.

    Args:
      target: the measurements.
      problem: what may be changed.
      simulators: of the problem's grasps.
      start: coordinates to start from, ``(p,)``.
      correction: exact minus cheap prediction near the start; found there if not given.
      rounds: how often the correction is renewed; with 0 it stays as given, and the fit is a rough one.
      free: which coordinates may change, ``(p,)``; all by default.
      known_slopes: of the first k coordinates from an earlier fit nearby, ``(G, S, C, k)``; they are kept, which spares
        most of the simulations.
      slopes: the same, for the start alone.
      at_the_end: whether slopes are measured where the fit ends, too, which takes most of the simulations; otherwise
        they are those that led there.
    """
    local = LocalSlopes(target, problem, simulators.cheap, simulators.cheap, known_slopes, simulators.step)
    vector = np.clip(start, problem.low + 1e-9, problem.high - 1e-9)
    if slopes is not None:
        local.begin(vector, slopes)
    free = np.ones(len(problem), bool) if free is None else free
    if correction is None:
        correction = 0.0 if simulators.one_model else _difference(problem, simulators, vector)
    total = 0
    for _ in range(max(1, rounds) if free.any() else 0):
        vector, count = _descend(local, vector, correction, free, rough=rounds == 0)
        total += count
        if simulators.one_model or rounds == 0:
            break
        renewed = _difference(problem, simulators, vector)
        change = np.sqrt(np.mean(((renewed - correction) / target.sigma)[target.mask] ** 2))
        correction = renewed
        if change < 0.02:
            break
    return _finish(local, vector, local.value(vector) + correction, correction, free, total, at_the_end)


def descend_roughly(
    target: Target, problem: Problem, simulators: Simulators, start: np.ndarray, correction: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Where a rough fit from one start ends, ``(p,)``, and the residuals there; less than :func:`fit_once` simulates.

    Args:
      target, problem, simulators, start, correction: as there.
    """
    local = LocalSlopes(target, problem, simulators.cheap, simulators.cheap, None, simulators.step)
    vector = np.clip(start, problem.low + 1e-9, problem.high - 1e-9)
    vector, _ = _descend(local, vector, correction, np.ones(len(problem), bool), rough=True)
    return vector, target.residual(local.value(vector) + correction)


def fit_exactly(
    target: Target, problem: Problem, simulators: Simulators, start: np.ndarray, slopes: np.ndarray | None = None,
    patient: bool = False,
) -> Fit:  # fmt: skip
    """Fits the model itself, near an optimum, with slopes from the cheap one where the gripper has a fast tier.

    For effects with memory, such as play: where the two models differ, no correction makes up for it.

    Args:
      target, problem, simulators, start: as for :func:`fit_once`.
      slopes: of the first k coordinates, as they were found near the start, ``(G, S, C, k)``, which spares finding them
        there.
      patient: goes on with ever shorter steps where slopes promise a gain that no step holds: contacts make them rough.
    """
    local = LocalSlopes(target, problem, simulators.exact, simulators.at_the_end, None, simulators.step)
    free = np.ones(len(problem), bool)
    start = np.clip(start, problem.low + 1e-9, problem.high - 1e-9)
    if slopes is not None:
        local.begin(start, slopes)
    vector, total = _descend(local, start, 0.0, free, rough=False, patient=patient)
    exact = local.value(vector)
    cheap = exact if simulators.one_model else predict(simulators.cheap, [problem.case(vector)])[0]
    return _finish(local, vector, exact, exact - cheap, free, total)


def with_own_slopes(fit: Fit, target: Target, simulators: Simulators, progress: Progress = silent) -> Fit:
    """The fit with slopes of the model itself, and where they lead; as it is if the cheap one's are as good.

    Larger steps make another lag of a short one: slopes from them leave a fit beside the optimum where parameters are
    hardly told apart, and make intervals too narrow.

    Args:
      fit: from :func:`fit_once`.
      target, simulators: of the same problem.
      progress: told that this takes long.
    """
    if simulators.at_the_end is simulators.cheap:
        return fit
    progress("base model, with the scene's own steps")
    return fit_exactly(target, fit.problem, simulators, fit.vector)


def _descend(
    local: LocalSlopes, start: np.ndarray, shift: np.ndarray | float, free: np.ndarray, rough: bool,
    patient: bool = False,
) -> tuple[np.ndarray, int]:  # fmt: skip
    """Goes to the next optimum in the free coordinates; also returns the number of evaluations.

    Slopes that only followed the values may lead nowhere; those measured where they end tell, and lead on.
    """
    most, failed = (_AT_MOST, _PATIENCE) if patient else (_EVALUATIONS, _FAILED)
    vector, count = _descend_once(local, start, shift, free, rough, most, failed)
    while not rough and count < most and _may_fall(local, vector, shift, free):
        vector, more = _descend_once(local, vector, shift, free, rough, most - count, failed)
        count += more
    return vector, count


def _may_fall(local: LocalSlopes, vector: np.ndarray, shift: np.ndarray | float, free: np.ndarray) -> bool:
    """Whether slopes that are measured where a descent ended promise more than the ones that it ended with."""
    if local.has_measured(vector):
        return False
    problem, residual = local.problem, _left(local, vector, shift)
    if residual @ residual > _NEAR**2 * local.target.readings:
        return False
    inside = free & (vector > problem.low + 1e-6) & (vector < problem.high - 1e-6)
    slopes = _slopes(local, vector, anew=True)[:, inside]
    gain = residual @ slopes @ np.linalg.lstsq(slopes, residual, rcond=1e-6)[0]
    return bool(gain * local.target.readings > _WORTH * (residual @ residual))


def _left(local: LocalSlopes, vector: np.ndarray, shift: np.ndarray | float) -> np.ndarray:
    """Residuals ÷ noise as they count, of predictions shifted by so much, and the priors', ``(N + priors,)``."""
    residual = local.target.residual(local.value(vector) + shift)
    return local.problem.priors.beside(local.target.weight * residual, vector)


def _slopes(local: LocalSlopes, vector: np.ndarray, anew: bool = False) -> np.ndarray:
    """Slopes of the predictions ÷ noise as they count, and of the priors, ``(N + priors, p)``."""
    slopes = (local.target.weight[..., None] * local.slopes(vector, anew=anew)).reshape(-1, len(vector))
    return local.problem.priors.below(slopes)


def _descend_once(
    local: LocalSlopes, start: np.ndarray, shift: np.ndarray | float, free: np.ndarray, rough: bool, evaluations: int,
    most_failed: int,
) -> tuple[np.ndarray, int]:  # fmt: skip
    def whole(part: np.ndarray) -> np.ndarray:
        vector = start.copy()
        vector[free] = part
        return vector

    problem = local.problem
    tolerance, flat = (_ROUGH, _ROUGH) if rough else (_TOLERANCE, _FLAT / max(local.target.readings, 1))
    best, count, failed = (start, np.inf, np.empty(0)), 0, 0

    def residual(part: np.ndarray) -> np.ndarray:
        nonlocal best, count, failed
        vector = whole(part)
        residual = _left(local, vector, shift)
        cost, count = float(residual @ residual), count + 1
        if cost < best[1]:
            best, failed = (vector, cost, local.value(vector)), 0
            return -residual
        failed += 1
        small = cost < (1 + flat) * best[1] or np.abs(vector - best[0]).max() < _SMALLEST_STEP
        impatient = small and most_failed == _FAILED
        if impatient or (failed == most_failed and not rough):  # a rough one may be far off, where steps are long
            raise _SettledError
        return -residual

    with contextlib.suppress(_SettledError):
        least_squares(
            residual,
            start[free],
            # scipy is not annotated: its type is guessed from its default, a string
            jac=lambda part: _slopes(local, whole(part))[:, free],  # pyright: ignore[reportArgumentType]
            bounds=(problem.low[free], problem.high[free]),
            x_scale="jac",
            ftol=tolerance,
            xtol=1e-6,
            gtol=1e-10,
            max_nfev=evaluations,
        )
    local.recall(best[0], best[2])
    return best[0], count


class _SettledError(Exception):
    """A step that slopes promised a gain for made as good as no difference."""


def _finish(
    local: LocalSlopes, vector: np.ndarray, predicted: np.ndarray, correction, free: np.ndarray, total: int,
    anew: bool = True,
) -> Fit:  # fmt: skip
    problem, weight = local.problem, local.target.weight
    residual, jacobian = local.target.residual(predicted), local.slopes(vector, anew) if anew else local.latest(vector)
    correction = np.broadcast_to(correction, predicted.shape)
    fit = Fit(problem, vector, predicted, residual, jacobian, correction, 0.0, total, weight)
    flat = fit.slopes
    slope = flat.T @ fit.left / np.maximum(np.linalg.norm(flat, axis=0), 1e-12)
    blocked = ~free | ((vector <= problem.low + 1e-6) & (slope < 0)) | ((vector >= problem.high - 1e-6) & (slope > 0))
    steepest = float(np.abs(slope[~blocked]).max(initial=0))
    return dataclasses.replace(fit, gradient=steepest)


def _difference(problem: Problem, simulators: Simulators, vector: np.ndarray) -> np.ndarray:
    case = [problem.case(vector)]
    return predict(simulators.exact, case)[0] - predict(simulators.cheap, case)[0]
