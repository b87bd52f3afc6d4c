"""Which effects are worth a fit: all are tried on few grasps, and what shows there, or not at all, on every grasp."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from forcegrasp.diagnosis.evidence import ALARM
from forcegrasp.diagnosis.families import may_join
from forcegrasp.diagnosis.noise.noise_check import Noise
from forcegrasp.diagnosis.signatures import Background, Score, Signatures, null_gains, share_together, trials
from forcegrasp.diagnosis.study import Study
from forcegrasp.diagnosis.verdict import LEAST_SHARE
from forcegrasp.effects import Effect
from forcegrasp.effects.setting import EffectSetting
from forcegrasp.identify.fit import Fit

# A signature this much worse than the best is not refitted.
_MIN_GAIN_RATIO = 0.2
#: A refit gains at most about twice what a signature promises.
MAX_GAIN_FACTOR = 0.5
# A signature on few grasps, or of an earlier round, is simulated anew on all if it gains this share of what makes its
# effect worth a fit.
_RESIMULATE_RATIO = 0.4


@dataclass(frozen=True)
class Look:
    """What signatures say of a fit."""

    scores: tuple[Score, ...]  #: the best one of each effect and variant, best first
    worth_a_fit: tuple[Score, ...]  #: those of them that gain enough
    null: np.ndarray  #: gains of the best signature of noise, from :func:`.null_gains`
    share_together: float  #: of the squares beyond the noise that all signatures explain together


class Screen:
    """Signatures of a catalogue, over the rounds of a search.

    Most effects show as little on few grasps as on all. Those that may be worth a fit are simulated on every grasp, and
    so is what few grasps show no trace of: force may saturate in one grasp only.

    Args:
      effects: the catalogue.
      study: the measurements.
    """

    def __init__(self, effects: Sequence[type[Effect]], study: Study) -> None:
        self._tried = trials(effects)
        self._on_all, self._few = Signatures(study), study.few
        self._on_few: Signatures | None = None

    def look(
        self,
        study: Study,
        fit: Fit,
        background: Background,
        effects: Collection[type[Effect]],
        noise: Noise | None,
        rng: np.random.Generator,
    ) -> Look:
        """Ranks effects by how well their signatures fit what a fit leaves.

        Args:
          study: the measurements.
          fit: of the model without these effects.
          background: what gets no credit on all grasps.
          effects: those of the catalogue that are tried.
          noise: where it is not as was assumed.
          rng: for the null distribution.
        """
        tried = [trial for trial in self._tried if trial.effect in effects]
        some, part = study.on_few(fit)
        few, new = self.on_few(study, some, part, effects)
        null = null_gains(
            few,
            rng,
            noise=None if noise is None else np.maximum(noise.ratio, 1.0),
            slow=None if noise is None else (noise.memory, noise.slow_share, part.residual.shape[1]),
        )
        beyond = some.target.beyond_noise(part.residual)
        least = _RESIMULATE_RATIO * _least_gain(few, null, beyond)
        best = [group[0] for group in few]
        promising = [trial for score in best if score.gain > least for trial in score.tried]
        if some is study:  # what was simulated just now need not be again
            self._on_all.simulate(fit, [trial for trial in promising if trial not in new])
        else:
            shown = {score.setting.kind for score in best}
            unseen = [trial for trial in tried if trial.kind not in shown]
            self._on_all.simulate(fit, [*promising, *self._on_all.missing(unseen)])
            promising += unseen
        groups = self._on_all.scores(fit, background, promising)
        found = sorted((group[0] for group in groups), key=lambda score: -score.gain)
        others = sorted((score for score in best if score.gain <= least), key=lambda score: -score.gain)
        enough = _least_gain(groups, null, study.target.beyond_noise(fit.residual))
        worth_a_fit = tuple(score for score in found if score.gain > enough)
        return Look((*found, *others), worth_a_fit, null, share_together(best, part, beyond))

    def on_few(
        self, study: Study, some: Study, fit: Fit, effects: Collection[type[Effect]]
    ) -> tuple[list[list[Score]], list[EffectSetting]]:
        """How well signatures fit what a fit of few grasps leaves.

        Args:
          study: the measurements.
          some: the few of them.
          fit: of the few, without these effects.
          effects: those of the catalogue that are tried.

        Returns:
          The scores as :meth:`.Signatures.scores` has them, and the trials that were simulated for it: all others
          were before.
        """
        if study.few is not self._few or self._on_few is None:
            self._few, self._on_few = study.few, self._on_all if some is study else Signatures(some)
        tried = [trial for trial in self._tried if trial.effect in effects]
        new = self._on_few.missing(tried)
        self._on_few.simulate(fit, new)
        return self._on_few.scores(fit, Background(fit, some.numerical), tried), new

    def one_after_the_other(
        self, study: Study, fit: Fit, effects: Collection[type[Effect]], most: int, least: float
    ) -> list[Score]:
        """The signatures that fit best what a fit leaves of few grasps, each beside those before it.

        That is orthogonal matching pursuit (Pati, Rezaiifar, Krishnaprasad 1993).

        Args:
          study: the measurements.
          fit: of the model without these effects.
          effects: those of the catalogue that are tried; one that may not join those before it is left out.
          most: how many at most.
          least: the share of the squares beyond the noise that each must gain beside the others.
        """
        some, part = study.on_few(fit)
        self.on_few(study, some, part, effects)
        background, chosen = Background(part, some.numerical), list[Score]()
        least *= max(some.target.beyond_noise(part.residual), 0.0)
        while len(chosen) < most and self._on_few is not None:
            before = [score.setting.effect for score in chosen]
            tried = [trial for trial in self._tried if trial.effect in effects and may_join(trial.effect, before)]
            groups = self._on_few.scores(part, background, tried)
            best = max((group[0] for group in groups), key=lambda score: score.gain, default=None)
            if best is None or best.gain <= least:
                break
            chosen.append(best)
            background = background.and_also(best.signature)
        return chosen


def _least_gain(groups: Sequence[Sequence[Score]], null: np.ndarray, beyond: float) -> float:
    """What a signature must gain for its effect to be worth a fit.

    Args:
      groups: the scores of each effect and variant, best first.
      null: gains of the best signature of noise.
      beyond: sum of squares that is left beyond the noise.
    """
    best = max((group[0].gain for group in groups), default=np.inf)
    return max(float(np.quantile(null, 1 - ALARM)), _MIN_GAIN_RATIO * best, MAX_GAIN_FACTOR * LEAST_SHARE * beyond)
