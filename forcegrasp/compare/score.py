"""How well the signature of each effect fits what the base model leaves, before any effect is fitted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from forcegrasp.compare.fit import Fit, Simulators
from forcegrasp.compare.predict import Applied, Case, predict
from forcegrasp.compare.target import Target
from forcegrasp.effects import Effect

# A signature stands for all smaller sizes, and for sizes up to this much larger than the one it was simulated with.
_REACH = 3.0


# Parameters, gain and signature, as in a Score; None where there is no trace.
_Found = tuple[np.ndarray, float, np.ndarray] | None
# Sizes around the promised one that are looked at before an effect is fitted.
_SIZES = (0.4, 0.6, 0.8, 1.0, 1.3, 1.6, 2.0, 2.6)


@dataclass(frozen=True)
class Score:
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


def score_effects(
    fit: Fit, target: Target, simulators: Simulators, background: Background, effects: Sequence[type[Effect]]
) -> list[list[Score]]:
    """Scores effects on top of a fit by their finite-size signatures.

    Returns:
      For each effect and variant all its trials' scores, best first; effects that leave no trace are missing.
    """
    tried = [(e, variant, values) for e in effects for variant in e.variants for values in e.trials()]
    change = _changes(tried, fit, target, simulators)
    clean = background.remove(change)
    residual = fit.residual.ravel()
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


def best_size(score: Score, fit: Fit, target: Target, simulators: Simulators, background: Background) -> np.ndarray:
    """The effect's parameters with the first one at the size that leaves least, ``(parameters,)``.

    A signature is straight, and thresholds are not: several sizes around the one it promises are simulated.
    """
    first = score.effect.parameters[0]
    if _is_linear(score.effect) or first.logarithmic or score.values[0] == 0:
        return score.values
    sizes = np.unique(np.clip(score.values[0] * np.array(_SIZES), first.low, first.high))
    tried = [np.array([size, *score.values[1:]]) for size in sizes]
    change = _changes([(score.effect, score.variant, values) for values in tried], fit, target, simulators)
    left = background.remove(fit.residual.reshape(-1, 1) - change)
    return tried[int(np.argmin(np.sum(left**2, axis=0)))]


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
