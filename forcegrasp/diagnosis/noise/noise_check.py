"""Whether what a model leaves is noise of another size or shape than was assumed: alike everywhere."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr, ndtri

from forcegrasp.diagnosis.noise.slow_noise import fit_slow_part, innovations
from forcegrasp.diagnosis.noise.stray_readings import stray_readings
from forcegrasp.identify.cross_validation import rms
from forcegrasp.identify.noise_floor import excess, numerical_floor
from forcegrasp.identify.target import Target

# Lags over which a missing effect would show, in samples.
_LAGS = 5
# Of the mean square beyond the assumed noise, so much may follow from the sample before and still be called
# noise: no effect that explains less is looked for. And so much may phases, speeds and forces differ by.
_IN_TIME, _BETWEEN_GROUPS = 0.25, 0.35
# A group has the assumed noise if that explains it so much better than the noise of all groups (likelihood ratio),
# times the number of groups that are asked (Bonferroni).
_RATIO, _LEAST_SAMPLES = 3.0, 40
# Residuals are counted between these quantiles of their sizes, and beyond so many σ; the rarest class is of this share.
_QUANTILES, _OUTLIER, _LEAST_SHARE = (0.25, 0.5, 0.75, 0.9, 0.97), 4.0, 1e-3
# Readings that scatter less than this share of the assumed noise.
_SMALLER = 0.8
# rms ÷ core above which tails are heavy: 1 if the noise is normal, 1.5 with three degrees of freedom.
_HEAVY = 1.2
# Whose rms is off by less has the size that was assumed.
_AS_ASSUMED = 0.05
# Noise may lean on the reading before it by so much; slower, it can't be told from a model's error. Of noise that does
# the state may explain this share of the mean square.
_SLOWEST, _BY_STATE = 0.98, 0.05
# Nor is it noise if it is so many times what was assumed. Of a servo it never is: its state, which repeats no motion,
# foretells little of what a lag or an elastic load leaves.
_MOST_SLOW = 4.0
# Groups of several partitions overlap: each is made level so many times.
_LEVELLED = 3
# Random features, what a unit of their weights costs, and folds of grasps.
_FEATURES, _RIDGE, _FOLDS = 100, 1.0, 4
# Below this quantile of how fast motion changes it is steady: a mass that is moved along shows beyond it alone.
_JERKED = 0.9
# Half of a normal distribution lies within so many σ.
_MEDIAN = float(ndtri(0.75))


@dataclass(frozen=True)
class Noise:
    """Noise that is not as assumed. One figure per signal, unless stated otherwise."""

    ratio: np.ndarray  #: rms of the residuals ÷ the assumed noise, ``(C,)``
    core: np.ndarray  #: the same of the middle half of them, which tails don't reach, ``(C,)``
    affected: np.ndarray  #: which signals it concerns, ``(C,)``
    #: Correlation of the slow part of each reading's noise with that of the reading before, and that part's share of
    #: the variance, ``(C,)``; 0 if white.
    memory: np.ndarray
    slow_share: np.ndarray
    has_stray: np.ndarray | bool = False  #: whether single readings that are far off are all that is odd, ``(C,)``

    @property
    def heavy_tails(self) -> np.ndarray:
        """Which of these signals have more outliers than a normal distribution, ``(C,)``."""
        return self.affected & (self.has_stray | (self.ratio > _HEAVY * self.core))

    @property
    def has_tails_alone(self) -> bool:
        """Whether these signals scatter as much as was assumed, and only have more outliers."""
        as_assumed = np.abs(self.ratio - 1) < _AS_ASSUMED
        return bool(np.all((as_assumed & self.heavy_tails)[self.affected]))

    @property
    def stronger(self) -> bool:
        """Whether some signal is noisier than assumed, or has more outliers."""
        return bool(np.any(self.affected & (self.ratio > 1)) or self.heavy_tails.any())


def unexpected_noise(
    residual: np.ndarray, numerical: Sequence[np.ndarray], target: Target, predicted: np.ndarray
) -> Noise | None:
    """The noise, if it is not as assumed and all that residuals show; None if it is, or if they show more than noise.

    A signal's residuals are judged by their normal scores: each is replaced by the quantile that its size has among
    all of them, with its sign. So neither the noise's size nor its tails count. Noise that is slow, as behind a
    filter, is judged by what is new in each reading, and only if nothing in the model's state foretells it.

    Args:
      residual: of held-out grasps, in units of the noise, ``(G, S, C)``.
      numerical: as for :func:`~forcegrasp.identify.noise_floor.numerical_floor`.
      target: the measurements.
      predicted: signals, ``(G, S, C)``; by them, for they have no noise, slow and fast samples are separated.
    """
    count = residual.shape[-1]
    one = np.eye(count, dtype=bool)
    ratio = np.array([rms(residual, target, signal) for signal in one])
    core = np.array([_core(residual[..., k][_present(residual[..., k], target)]) for k in range(count)])
    if not excess(residual, numerical, target):
        smaller = ratio < _SMALLER
        return Noise(ratio, core, smaller, np.zeros(count), np.zeros(count)) if smaller.any() else None
    clean, affected = residual.copy(), np.zeros(count, bool)
    memory, slow_share = np.zeros((2, count))
    states = [predicted[..., target.axis.side_of(k)] for k in range(count)]
    partitions = [_partitions(target, state) for state in states]
    for k, (signal, state, groups) in enumerate(zip(one, states, partitions, strict=True)):
        values, floor = residual[..., k], numerical_floor(numerical, target, signal)
        scores, beyond = _normal_scores(values, _present(values, target)), 1 - (min(floor, core[k]) / ratio[k]) ** 2
        if _some_group_as_assumed(values / floor, groups):
            continue
        if _is_white(scores, beyond, groups):
            clean[..., k], affected[k] = scores, True
            continue
        if target.gripper.is_servo or ratio[k] > _MOST_SLOW:
            continue
        leaning, share = fit_slow_part(scores)
        new = innovations(scores, leaning, share)
        if 0 < leaning < _SLOWEST and _is_white(new, beyond, groups) and foretold(scores, state, target) < _BY_STATE:
            clean[..., k], affected[k], memory[k], slow_share[k] = new, True, leaning, share
    if not excess(clean, numerical, target):
        return Noise(ratio, core, affected, memory, slow_share)
    stray = stray_readings(np.where(target.mask[..., None], residual, np.nan), partitions)
    if not stray.any() or excess(np.where(stray, np.nan, residual), numerical, target):
        return None
    has_stray = np.asarray(stray.any(axis=(0, 1)))
    return Noise(ratio, core, has_stray, np.zeros(count), np.zeros(count), has_stray)


def is_uneven_noise(
    residual: np.ndarray, numerical: Sequence[np.ndarray], target: Target, predicted: np.ndarray
) -> bool:
    """Whether all beyond the noise is white in time and foretold by nothing, but larger in some states than in others.

    Noise that grows with speed or force is so, and so are readings at uneven times, which show in motion. A law of
    forces is not: what it leaves repeats itself with the state.

    Args:
      residual, numerical, target, predicted: as for :func:`unexpected_noise`.
    """
    clean = residual.copy()
    for k in range(residual.shape[-1]):
        signal, state = np.arange(residual.shape[-1]) == k, predicted[..., target.axis.side_of(k)]
        groups, ratio = _partitions(target, state), rms(residual, target, signal)
        if ratio <= numerical_floor(numerical, target, signal):
            continue
        level = _levelled(np.where(target.mask, residual[..., k], np.nan), groups)
        scores = _normal_scores(level, _present(level, target))
        if _is_white(scores, 1 - 1 / ratio**2, groups) and foretold(scores, state, target) < _BY_STATE:
            clean[..., k] = scores
    return not excess(clean, numerical, target)


def _levelled(values: np.ndarray, partitions: Sequence[np.ndarray]) -> np.ndarray:
    """Values ``(G, S)`` ÷ their rms in each group of each partition."""
    level = values.copy()
    for _ in range(_LEVELLED):
        for partition in partitions:
            for group in range(partition.max() + 1):
                inside = (partition == group) & np.isfinite(level)
                if inside.any():
                    level[inside] /= max(float(np.sqrt(np.mean(level[inside] ** 2))), 1e-12)
    return level


def _present(values: np.ndarray, target: Target) -> np.ndarray:
    return target.mask & np.isfinite(values)


def _core(values: np.ndarray) -> float:
    return float(np.median(np.abs(values)) / _MEDIAN) if len(values) else float("nan")


def _normal_scores(values: np.ndarray, there: np.ndarray) -> np.ndarray:
    """Values with their signs and order, but normally distributed, ``(G, S)``; NaN where there are none."""
    inside = values[there]
    ranks = np.argsort(np.argsort(np.abs(inside)))
    scores = np.full(values.shape, np.nan)
    scores[there] = np.sign(inside) * ndtri(0.5 + 0.5 * (ranks + 0.5) / len(inside))
    return scores


def _partitions(target: Target, predicted: np.ndarray) -> tuple[np.ndarray, ...]:
    """Phases, slow and fast, steady and jerked, lightly and strongly pressed, each ``(G, S)``.

    That is where most errors of a model would differ.

    Args:
      target: the measurements.
      predicted: position and force, if there is one, of one side, ``(G, S, 2)``.
    """
    position = predicted[..., 0]
    motion = np.abs(np.diff(position, axis=1, prepend=position[:, :1]))
    sizes = (motion, *np.moveaxis(predicted[..., 1:], -1, 0))
    change = np.abs(np.diff(motion, axis=1, prepend=motion[:, :1]))
    split = [(x, 0.5) for x in sizes] + [(change, _JERKED)]
    parts = (np.where(x > np.quantile(x[target.mask], share), 1, 0) for x, share in split)
    return target.phase, *(np.where(target.mask, part, -1) for part in parts)


def _grouped(values: np.ndarray, partition: np.ndarray) -> list[np.ndarray]:
    """The numbers among values ``(G, S)`` of each group of a partition, where it has any."""
    groups = [values[(partition == k) & np.isfinite(values)] for k in range(partition.max() + 1)]
    return [group for group in groups if len(group)]


def _is_white(scores: np.ndarray, beyond: float, partitions: Sequence[np.ndarray]) -> bool:
    """Whether a signal's normal scores are white in time and alike in all groups, as far as its excess is concerned.

    In doubt they are not: what may be there, and too few samples can't tell, counts as if it were.

    Args:
      scores: ``(G, S)``; NaN where there are none.
      beyond: share of the mean square that is beyond the assumed noise.
      partitions: from :func:`_partitions`.
    """
    count = int(np.isfinite(scores).sum())
    lags = [np.nansum(scores[:, k:] * scores[:, :-k]) / count for k in range(1, _LAGS + 1)]
    if _at_most(float(np.mean(np.square(lags))), 1 / count, _LAGS) > _IN_TIME * beyond:
        return False
    for partition in partitions:
        groups = _grouped(scores, partition)
        differing = sum(len(values) * (np.mean(values**2) - 1) ** 2 for values in groups) / count
        if _at_most(float(differing), 2 * len(groups) / count, len(groups)) > _BETWEEN_GROUPS * beyond:
            return False
    return True


def foretold(values: np.ndarray, state: np.ndarray, target: Target) -> float:
    """Share of the mean square of values ``(G, S)`` that a smooth function of the state foretells in other grasps.

    The function is a ridge regression on random features (Rahimi and Recht 2007) of position, force, their speeds,
    and the time since the start and since the phase began. What a model lacks repeats itself with these, unlike noise.

    Args:
      values: NaN where there are none.
      state: position and force, if there is one, of the signal's side, ``(G, S, 2)``.
      target: the measurements.
    """
    there = np.isfinite(values)
    speed = np.diff(state, axis=1, prepend=state[:, :1])
    samples = np.broadcast_to(np.arange(values.shape[1]), values.shape)
    begins = np.diff(target.phase, axis=1, prepend=-2) != 0
    since = samples - np.maximum.accumulate(np.where(begins, samples, 0), axis=1)
    known = np.concatenate([state, speed, np.stack([samples, since], -1)], axis=-1)[there]
    known = (known - known.mean(0)) / np.maximum(known.std(0), 1e-12)
    rng = np.random.default_rng(0)
    features = np.cos(known @ rng.standard_normal((known.shape[1], _FEATURES)) + rng.uniform(0, 2 * np.pi, _FEATURES))
    wanted, grasp = values[there], np.nonzero(there)[0]
    left = np.empty_like(wanted)
    for fold in range(folds := min(_FOLDS, int(grasp.max()) + 1)):
        out = grasp % folds == fold
        inner = features[~out].T @ features[~out] + _RIDGE * np.eye(_FEATURES)
        left[out] = wanted[out] - features[out] @ np.linalg.solve(inner, features[~out].T @ wanted[~out])
    return 1 - float(np.mean(left**2) / np.mean(wanted**2))


def _some_group_as_assumed(values: np.ndarray, partitions: Sequence[np.ndarray]) -> bool:
    """Whether in some group a signal's residuals ÷ floor, ``(G, S)``, are as assumed, while others' are not."""
    sizes = np.abs(values)
    everything = sizes[(partitions[0] >= 0) & np.isfinite(sizes)]
    edges = np.unique([*np.quantile(everything, _QUANTILES), _OUTLIER])
    assumed = np.diff(np.r_[0.0, 2 * ndtr(edges) - 1, 1.0])

    def counted(values: np.ndarray) -> np.ndarray:
        return np.bincount(np.searchsorted(edges, values), minlength=len(assumed))

    of_all = counted(everything) / len(everything)
    evidence = np.log(np.maximum(of_all, _LEAST_SHARE) / np.maximum(assumed, _LEAST_SHARE))
    counts = [counted(group) for partition in partitions for group in _grouped(sizes, partition)]
    counts = [count for count in counts if count.sum() >= _LEAST_SAMPLES]
    return any(count @ evidence < -np.log(_RATIO * len(counts)) for count in counts)


def _at_most(square: float, of_noise: float, terms: int) -> float:
    """How large the root of a mean of so many squares may be in truth, if noise alone makes it ``of_noise``."""
    return float(np.sqrt(max(0.0, square - of_noise) + 2 * of_noise * np.sqrt(2 / terms)))
