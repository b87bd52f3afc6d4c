"""Rough fits with one more effect, from where signatures put them, or though these promise little."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from forcegrasp.diagnosis import families
from forcegrasp.diagnosis.result import Candidate
from forcegrasp.diagnosis.search.refine import best_as_given, refine, refine_anyway
from forcegrasp.diagnosis.search.screen import MAX_GAIN_FACTOR
from forcegrasp.diagnosis.search.start import Start
from forcegrasp.diagnosis.signatures import Score, best_effects, chance_of
from forcegrasp.diagnosis.verdict import LEAST_SHARE
from forcegrasp.effects import Effect
from forcegrasp.identify.noise_floor import excess
from forcegrasp.identify.side_by_side import side_by_side

# So many are fitted though their signatures promise too little.
_FITTED_ANYWAY = 12
# And of those that leave least beside base parameters as given, where much is left.
_AS_GIVEN = 4


class RoughFits:
    """Fits with one more effect.

    Args:
      start: of the step.
      null: gains of the best signature of noise.
    """

    def __init__(self, start: Start, null: np.ndarray) -> None:
        self._start, self._null = start, null
        self._study, self._fit = start.study, start.fit

    def of(self, scores: Sequence[Score]) -> list[Candidate]:
        """Rough fits with one more effect, from where the best signatures put them."""
        candidates = []
        for one in refine(scores, self._study, self._fit, self._start.background):
            p_family = chance_of(one.score.gain, self._null)
            candidates.append(self._start.judge(one.fit, p_family, one.score.signature))
        return candidates

    def of_richer(self, richer: Sequence[tuple[str, type[Effect]]]) -> list[Candidate]:
        """Fits with effects in the place of those in the model that they contain."""
        pairs = richer if excess(self._start.held, self._study.numerical, self._study.target) else ()
        enough = side_by_side([partial(self._may_explain_enough, effect, name) for name, effect in pairs])
        pairs = [pair for pair, may in zip(pairs, enough, strict=True) if may]
        tasks = [
            self._study.telling(
                f"{effect.name} in place of {name}",
                partial(families.refit_as_richer, effect, self._fit, name, self._study),
                self._fit,
            )
            for name, effect in pairs
        ]
        candidates = []
        for (name, effect), refit in zip(pairs, side_by_side(tasks), strict=True):
            if not any(families.falls_back(refit, nested) for nested in effect.contains):
                candidates.append(self._start.judge_by_gain(refit, self._null, name))
        return candidates

    def _may_explain_enough(self, richer: type[Effect], name: str) -> bool:
        """Whether few grasps let an effect gain enough in the place of one that it contains."""
        some, part = self._study.on_few(self._fit)
        if some is self._study:
            return True
        rough = families.roughly_as_richer(richer, part, name, some)
        return part.cost - rough.cost > MAX_GAIN_FACTOR * LEAST_SHARE * some.target.beyond_noise(part.residual)

    def anyway(self, scores: Sequence[Score]) -> list[Candidate]:
        """Rough fits with the effects of these signatures, whatever little they promise."""
        ordered = best_effects(scores, len(scores))
        # what takes the place of the scene's own law has no small size, and a signature that says little
        effects = [e for place, e in enumerate(ordered) if place < _FITTED_ANYWAY or e.instead_of]
        effects += [e for e in best_as_given(ordered, self._study, self._fit, _AS_GIVEN) if e not in effects]
        self._study.progress(f"fitting {len(effects)} effects, though their signatures promise little")
        return [self._start.judge_by_gain(fit, self._null) for fit in refine_anyway(effects, self._study, self._fit)]
