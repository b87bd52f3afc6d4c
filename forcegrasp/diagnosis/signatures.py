"""How well the signature of each effect fits what the base model leaves, before any effect is fitted."""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from forcegrasp.effects import Effect
from forcegrasp.identify.fit import Fit, Simulators
from forcegrasp.identify.predict import Applied, Case, predict
from forcegrasp.identify.target import Target
from forcegrasp.short_repr import ShortRepr

# A signature stands for all smaller sizes, and for sizes up to this much larger than the one it was simulated with.
_REACH = 3.0


# Parameters, gain and signature, as in a Score; None where there is no trace.
_Found = tuple[np.ndarray, float, np.ndarray] | None
# Sizes around the promised one that are looked at before an effect is fitted.
_SIZES = (0.45, 0.67, 1.0, 1.4, 1.9, 2.6)


@dataclass(frozen=True, repr=False)
class Score(ShortRepr):
    """The best signature of one effect and variant."""

    effect: type[Effect]
    variant: str
    values: np.ndarray  #: parameters that fit best, as far as a signature tells, ``(parameters,)``
    gain: float  #: fall of the sum of squared residuals
    signature: np.ndarray  #: unit vector over all residuals, base parameters projected out, ``(N,)``


class Background:
    """Directions that no effect gets credit for: the fitted parameters, and the model's own numerical error."""

    def __init__(self, fit: Fit, numerical: Sequence[np.ndarray]) -> None:
        columns = [fit.jacobian.reshape(-1, len(fit.problem)), *(n.reshape(-1, 1) for n in numerical)]
        matrix = np.concatenate(columns, axis=1)
        norms = np.linalg.norm(matrix, axis=0)
        left, singular, _ = np.linalg.svd(matrix[:, norms > 0] / norms[norms > 0], full_matrices=False)
        self._basis = left[:, singular > 1e-8 * singular[0]]

    def remove(self, vectors: np.ndarray) -> np.ndarray:
        """Takes the directions out of vectors, ``(N,)`` or ``(N, m)``."""
        return vectors - self._basis @ (self._basis.T @ vectors)


class Signatures:
    """What every effect changes of the signals, for each of its variants and trials, as it was simulated last.

    An effect that another one is added to changes its signature little. So a signature need not be simulated anew in
    each round, only where it may count.
    """

    def __init__(self, effects: Sequence[type[Effect]], target: Target, simulators: Simulators) -> None:
        self._target, self._simulators = target, simulators
        self._tried = [(e, variant, values) for e in effects for variant in e.variants for values in e.trials()]
        self._changes: list[np.ndarray] = [np.empty(0)] * len(self._tried)  # each ``(N,)``; not simulated yet if empty

    def _places(self, effects: Collection[type[Effect]]) -> list[int]:
        return [index for index, trial in enumerate(self._tried) if trial[0] in effects]

    def missing(self, effects: Sequence[type[Effect]]) -> list[type[Effect]]:
        """Those of the effects that were never simulated."""
        return [
            e for e in effects if any(t[0] is e and not len(c) for t, c in zip(self._tried, self._changes, strict=True))
        ]

    def simulate(self, fit: Fit, effects: Collection[type[Effect]]) -> None:
        """Simulates these effects on top of a fit, all at once."""
        places = self._places(effects)
        if places:
            changes = _changes([self._tried[i] for i in places], fit, self._target, self._simulators)
            for place, change in zip(places, changes.T, strict=True):
                self._changes[place] = change

    def scores(self, fit: Fit, background: Background, effects: Sequence[type[Effect]]) -> list[list[Score]]:
        """How well these effects fit what a fit leaves.

        Returns:
          For each effect and variant all its trials' scores, best first; effects that leave no trace are missing.
        """
        residual = fit.residual.ravel()
        places = self._places(effects)
        tried = [self._tried[i] for i in places]
        change = np.stack([self._changes[i] for i in places], axis=1)
        clean = background.remove(change)
        found: dict[tuple[type[Effect], str], list[Score]] = {}
        for (effect, variant), columns in _kinds(tried).items():
            if _is_linear(effect):
                options = [_joint(clean[:, columns], residual, [tried[c][2] for c in columns])]
            else:
                options = [_single(clean[:, c], change[:, c], residual, effect, tried[c][2]) for c in columns]
            scores = [Score(effect, variant, *option) for option in options if option is not None]
            if scores:
                found[effect, variant] = sorted(scores, key=lambda s: -s.gain)
        return list(found.values())


def best_sizes(
    scores: Sequence[Score], fit: Fit, target: Target, simulators: Simulators, background: Background
) -> list[Score]:
    """The same effects with their first parameters at the sizes that minimise the residual, and what these gain.

    A signature is straight, and thresholds are not: several sizes around the one it promises are simulated, those of
    all effects at once.
    """
    options = [_sizes(score) for score in scores]
    tried = [(s.effect, s.variant, values) for s, sizes in zip(scores, options, strict=True) for values in sizes]
    if not tried:
        return list(scores)
    residual = fit.residual.reshape(-1, 1)
    left = np.sum(background.remove(residual - _changes(tried, fit, target, simulators)) ** 2, axis=0)
    gains, found, low = np.sum(background.remove(residual) ** 2) - left, [], 0
    for score, sizes in zip(scores, options, strict=True):
        if sizes:
            best = int(np.argmax(gains[low : low + len(sizes)]))
            score = dataclasses.replace(score, values=sizes[best], gain=float(gains[low + best]))
        found.append(score)
        low += len(sizes)
    return found


def _sizes(score: Score) -> list[np.ndarray]:
    """Parameters of several sizes around a score's; none where signatures are straight."""
    first = score.effect.parameters[0]
    if _is_linear(score.effect) or first.logarithmic or score.values[0] == 0:
        return []
    sizes = np.unique(np.clip(score.values[0] * np.array(_SIZES), first.low, first.high))
    return [np.array([size, *score.values[1:]]) for size in sizes]


def _changes(
    tried: Sequence[tuple[type[Effect], str, np.ndarray]], fit: Fit, target: Target, simulators: Simulators
) -> np.ndarray:
    """What each effect of that variant and size changes of the signals ÷ noise, ``(N, tried)``, in one simulation."""
    start = fit.problem.case(fit.vector)
    cases = [start, *(Case(start.base, (*start.effects, Applied(*t))) for t in tried)]
    signals = predict(simulators.cheap, cases)
    return np.where(target.mask[..., None], (signals[1:] - signals[0]) / target.sigma, 0.0).reshape(len(tried), -1).T


def null_gains(scores: list[list[Score]], rng: np.random.Generator, draws: int = 400) -> np.ndarray:
    """Largest gain of any signature when nothing but sensor noise is left, ``(draws,)``.

    The base fit is simulated again with new noise; what it would absorb is already out of the signatures.
    """
    if not scores:
        return np.zeros(draws)
    signatures = np.stack([s.signature for group in scores for s in group], axis=1).astype(np.float32)
    gains = np.empty(draws)
    for low in range(0, draws, 50):
        count = min(50, draws - low)
        noise = rng.standard_normal((count, len(signatures)), dtype=np.float32)
        gains[low : low + count] = np.max((noise @ signatures) ** 2, axis=1)
    return gains


def _kinds(tried: list[tuple[type[Effect], str, np.ndarray]]) -> dict[tuple[type[Effect], str], list[int]]:
    kinds: dict[tuple[type[Effect], str], list[int]] = {}
    for index, (effect, variant, _) in enumerate(tried):
        kinds.setdefault((effect, variant), []).append(index)
    return kinds


def _is_linear(effect: type[Effect]) -> bool:
    """Whether each trial moves one parameter of several that may have either sign: then trials add up."""
    trials = effect.trials()
    return len(trials) > 1 and all(p.low < 0 < p.high for p in effect.parameters)


def _single(
    clean: np.ndarray, change: np.ndarray, residual: np.ndarray, effect: type[Effect], values: np.ndarray
) -> _Found:
    size = float(np.linalg.norm(clean))
    if size < 1e-3 * max(np.linalg.norm(change), 1e-9) or size < 1e-2:
        return None
    unit = clean / size
    along = float(unit @ residual)
    factor = along / size
    first = effect.parameters[0]
    low = -_REACH if first.low < 0 else 0.0
    factor = float(np.clip(factor, low, _REACH))
    gain = 2 * factor * size * along - (factor * size) ** 2
    if not first.logarithmic:  # a threshold that starts at infinity does not scale
        values = np.array([np.clip(values[0] * factor, first.low, first.high), *values[1:]])
    return values, gain, unit


def _joint(clean: np.ndarray, residual: np.ndarray, trials: list[np.ndarray]) -> _Found:
    if np.linalg.norm(clean, axis=0).min() < 1e-2:
        return None
    factors, *_ = np.linalg.lstsq(clean, residual, rcond=None)
    fitted = clean @ factors
    size = np.linalg.norm(fitted)
    return np.sum([f * t for f, t in zip(factors, trials, strict=True)], axis=0), float(size**2), fitted / size
