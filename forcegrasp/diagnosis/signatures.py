"""How well the signature of each effect fits what the base model leaves, before any effect is fitted."""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from forcegrasp.diagnosis.noise.slow_noise import through_filter
from forcegrasp.diagnosis.study import Study
from forcegrasp.effects import Effect
from forcegrasp.effects.setting import EffectSetting
from forcegrasp.identify.fit import Fit
from forcegrasp.identify.predict import Case, predict
from forcegrasp.identify.priors import with_rows
from forcegrasp.short_repr import ShortRepr

# A signature stands for all smaller sizes, and for sizes up to this much larger than the one it was simulated with.
_REACH = 3.0
# Sizes around the promised one that are looked at before an effect is fitted.
_SIZES = (0.45, 0.67, 1.0, 1.4, 1.9, 2.6)


@dataclass(frozen=True, repr=False)
class Score(ShortRepr):
    """The best signature of one effect and variant."""

    setting: EffectSetting  #: with the values that fit best, as far as a signature tells
    gain: float  #: fall of the sum of squared residuals
    signature: np.ndarray  #: unit vector over all residuals, base parameters projected out, ``(N,)``
    tried: tuple[EffectSetting, ...] = ()  #: the trials that it is made of


class Background:
    """Directions that no effect gets credit for: the fitted parameters, and the model's own numerical error.

    Args:
      fit: whose parameters count.
      numerical: errors of the model, each ``(G, S, C)``.
      without: indices of parameters that do not count.
    """

    def __init__(self, fit: Fit, numerical: Sequence[np.ndarray], without: Sequence[int] = ()) -> None:
        slopes = np.delete(fit.slopes, without, axis=1)
        columns = [slopes, *(fit.weighted(n)[:, None] for n in numerical)]
        matrix = np.concatenate(columns, axis=1)
        norms = np.linalg.norm(matrix, axis=0)
        left, singular, _ = np.linalg.svd(matrix[:, norms > 0] / norms[norms > 0], full_matrices=False)
        self._basis = left[:, singular > 1e-8 * singular[0]]

    def remove(self, vectors: np.ndarray) -> np.ndarray:
        """Takes the directions out of vectors, with rows for priors, ``(N + priors, ...)``."""
        vectors = with_rows(vectors, len(self._basis))
        return vectors - self._basis @ (self._basis.T @ vectors)

    def and_also(self, signature: np.ndarray) -> Background:
        """The same with one more direction, that of a signature that has nothing of the others, ``(N,)``."""
        more = copy.copy(self)
        more._basis = np.column_stack([self._basis, with_rows(signature, len(self._basis))])
        return more


def direction(before: Fit, after: Fit) -> np.ndarray:
    """What one fit changes of the weighted residuals of another, ``(N,)``, scaled to length 1."""
    change = (after.weight * (before.residual - after.residual)).ravel()
    return change / max(float(np.linalg.norm(change)), 1e-9)


def trials(effects: Sequence[type[Effect]]) -> list[EffectSetting]:
    """Every trial of every variant of these effects."""
    return [one for effect in effects for variant in effect.variants for one in trials_of(effect, variant)]


def trials_of(effect: type[Effect], variant: str) -> list[EffectSetting]:
    """The sizes of one variant of an effect that are tried."""
    return [EffectSetting(effect, variant, values) for values in effect.trials()]


class Signatures:
    """What trials change of the signals, as they were simulated last.

    An effect that another one is added to changes its signature little. So a signature need not be simulated anew in
    each round, only where it may count.
    """

    def __init__(self, study: Study) -> None:
        self._study = study
        self._changes: dict[EffectSetting, np.ndarray] = {}  # each ``(N,)``

    def missing(self, tried: Sequence[EffectSetting]) -> list[EffectSetting]:
        """Those of the trials that were never simulated."""
        return [trial for trial in tried if trial not in self._changes]

    def simulate(self, fit: Fit, tried: Sequence[EffectSetting]) -> None:
        """Simulates trials on top of a fit, all at once."""
        if tried:
            self._changes.update(zip(tried, _changes(tried, self._study, fit).T, strict=True))

    def scores(self, fit: Fit, background: Background, tried: Sequence[EffectSetting]) -> list[list[Score]]:
        """How well trials fit what a fit leaves.

        Returns:
          For each effect and variant all its trials' scores, best first; effects that leave no trace are missing.
        """
        if not tried:
            return []
        change = _weighted(np.stack([self._changes[trial] for trial in tried], axis=1), fit)
        clean = background.remove(change)
        found: dict[tuple[type[Effect], str], list[Score]] = {}
        for kind, columns in _kinds(tried).items():
            if _is_linear(kind[0]):
                options = [_joint(clean[:, columns], fit.left, [tried[c] for c in columns], fit.residual.size)]
            else:
                options = [_single(clean[:, c], change[:, c], fit.left, tried[c]) for c in columns]
            scores = [option for option in options if option is not None]
            if scores:
                found[kind] = sorted(scores, key=lambda s: -s.gain)
        return list(found.values())


def of_best_effects(scores: Sequence[Score], most: int) -> list[Score]:
    """Of scores, the best first, those of so many effects: variants of one must not crowd out other effects."""
    effects = best_effects(scores, most)
    return [score for score in scores if score.setting.effect in effects]


def best_effects(scores: Sequence[Score], most: int) -> list[type[Effect]]:
    """The effects of scores, the best first, so many at most."""
    return list(dict.fromkeys(score.setting.effect for score in scores))[:most]


def share_together(scores: Sequence[Score], fit: Fit, beyond: float) -> float:
    """Share of the squares beyond the noise that signatures explain all together, of whatever size and sign.

    Args:
      scores: the best signature of each effect and variant.
      fit: what they are signatures on.
      beyond: sum of squares that it leaves beyond the noise.
    """
    if not scores:
        return 0.0
    signatures = np.stack([score.signature for score in scores], axis=1)
    residual = (fit.weight * fit.residual).ravel()
    sizes = np.linalg.lstsq(signatures, residual, rcond=1e-6)[0]
    return float(residual @ signatures @ sizes) / max(beyond, 1e-9)


def best_sizes(scores: Sequence[Score], study: Study, fit: Fit, background: Background) -> list[tuple[Score, float]]:
    """The same effects with their first parameters at the sizes that minimise the residual, and what these gain.

    A signature is straight, and thresholds are not: several sizes around the one it promises are simulated on few
    grasps, those of all effects at once, and the best one of each on all.

    Returns:
      Each effect with what its best size gains on all grasps, and what on the few; NaN where no sizes were tried.
    """
    options = [sizes_around(score.setting) for score in scores]
    some, part = study.on_few(fit)
    gains = iter(_gains([one for sizes in options for one in sizes], some, part, Background(part, some.numerical)))
    best: list[EffectSetting | None] = []
    on_few: list[float] = []
    for sizes in options:
        gain = [next(gains) for _ in sizes]
        best.append(sizes[int(np.argmax(gain))] if sizes else None)
        on_few.append(max(gain, default=np.nan))
    gains = iter(_gains([one for one in best if one is not None], study, fit, background))
    sized = [
        score if one is None else dataclasses.replace(score, setting=one, gain=next(gains))
        for score, one in zip(scores, best, strict=True)
    ]
    return list(zip(sized, on_few, strict=True))


def _gains(tried: Sequence[EffectSetting], study: Study, fit: Fit, background: Background) -> list[float]:
    """By how much each of these effects lowers the sum of squares, as it is."""
    if not tried:
        return []
    residual = fit.left[:, None]
    left = background.remove(residual - with_rows(_weighted(_changes(tried, study, fit), fit), len(residual)))
    return (np.sum(background.remove(residual) ** 2) - np.sum(left**2, axis=0)).tolist()


def sizes_around(one: EffectSetting, times: Sequence[float] = _SIZES) -> list[EffectSetting]:
    """A setting with its first parameter at so many times its value; none where signatures are straight."""
    first = one.effect.parameters[0]
    if _is_linear(one.effect) or first.logarithmic or one.values[0] == 0:
        return []
    sizes = np.unique(np.clip(one.values[0] * np.array(times), first.low, first.high))
    return [dataclasses.replace(one, values=np.array([size, *one.values[1:]])) for size in sizes]


def _changes(tried: Sequence[EffectSetting], study: Study, fit: Fit) -> np.ndarray:
    """What each effect changes of the signals ÷ noise, ``(N, tried)``, in one simulation."""
    start = fit.problem.case(fit.vector)
    cases = [start, *(Case(start.base, (*start.effects, one)) for one in tried)]
    signals = predict(study.rough or study.simulators.cheap, cases)
    return study.target.change(signals[1:], signals[0]).reshape(len(tried), -1).T


def _weighted(changes: np.ndarray, fit: Fit) -> np.ndarray:
    """Changes of the signals, ``(N, tried)``, as they count in a fit."""
    return changes * np.broadcast_to(fit.weight, fit.residual.shape).reshape(-1, 1)


def chance_of(gain: float, null: np.ndarray) -> float:
    """Probability that the best signature of noise gains as much; ``null``: what it gains in draws, ``(draws,)``."""
    return (1 + int(np.sum(null >= gain))) / (1 + len(null))


def null_gains(
    scores: list[list[Score]],
    rng: np.random.Generator,
    draws: int = 400,
    noise: np.ndarray | None = None,
    slow: tuple[np.ndarray, np.ndarray, int] | None = None,
) -> np.ndarray:
    """Largest gain of any signature when nothing but sensor noise is left, ``(draws,)``.

    The base fit is simulated again with new noise; what it would absorb is already out of the signatures.

    Args:
      scores: the signatures of each effect and variant.
      rng: draws the noise.
      draws: how often.
      noise: what it is ÷ what was assumed, of each signal, ``(C,)``; as assumed by default.
      slow: memory and share of the slow part of each signal's noise, ``(C,)`` each, and samples per grasp; by default
        it is white.
    """
    if not scores:
        return np.zeros(draws)
    signatures = np.stack([s.signature for group in scores for s in group], axis=1).astype(np.float32)
    if noise is not None:  # a signature adds up many readings: of heavy tails nothing is left but their variance
        signatures *= np.tile(noise, len(signatures) // len(noise))[:, None].astype(np.float32)
    if slow is not None:
        signatures = through_filter(signatures, *slow)
    gains = np.empty(draws)
    for low in range(0, draws, 50):
        count = min(50, draws - low)
        noise = rng.standard_normal((count, len(signatures)), dtype=np.float32)
        gains[low : low + count] = np.max((noise @ signatures) ** 2, axis=1)
    return gains


def _kinds(tried: Sequence[EffectSetting]) -> dict[tuple[type[Effect], str], list[int]]:
    kinds: dict[tuple[type[Effect], str], list[int]] = {}
    for index, one in enumerate(tried):
        kinds.setdefault(one.kind, []).append(index)
    return kinds


def _is_linear(effect: type[Effect]) -> bool:
    """Whether each trial moves one parameter of several that may have either sign: then trials add up."""
    trials = effect.trials()
    return len(trials) > 1 and all(p.low < 0 < p.high for p in effect.parameters)


def _single(clean: np.ndarray, change: np.ndarray, residual: np.ndarray, one: EffectSetting) -> Score | None:
    """Score of a trial whose signature is stretched as far as it may be; None where it leaves no trace."""
    size = float(np.linalg.norm(clean))
    if size < 1e-3 * max(np.linalg.norm(change), 1e-9) or size < 1e-2:
        return None
    unit = clean / size
    along = float(unit @ residual)
    factor = along / size
    first, values = one.effect.parameters[0], one.values
    low = -_REACH if first.low < 0 and values[0] != first.null else 0.0
    factor = float(np.clip(factor, low, _REACH))
    gain = 2 * factor * size * along - (factor * size) ** 2
    if not first.logarithmic:  # a threshold that starts at infinity does not scale
        values = np.array([np.clip(values[0] * factor, first.low, first.high), *values[1:]])
    return Score(dataclasses.replace(one, values=values), gain, unit[: len(change)], (one,))


def _joint(clean: np.ndarray, residual: np.ndarray, trials: Sequence[EffectSetting], readings: int) -> Score | None:
    """Score of several trials of an effect, added up; None where one leaves no trace."""
    if np.linalg.norm(clean, axis=0).min() < 1e-2:
        return None
    factors, *_ = np.linalg.lstsq(clean, residual, rcond=None)
    fitted = clean @ factors
    size = np.linalg.norm(fitted)
    values = np.sum([factor * one.values for factor, one in zip(factors, trials, strict=True)], axis=0)
    return Score(dataclasses.replace(trials[0], values=values), float(size**2), fitted[:readings] / size, tuple(trials))
