"""What a step of the search starts from, and what it asks of an effect."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from forcegrasp.diagnosis.evidence import LEAST_SHARE_OF_MANY, is_significant, outdone
from forcegrasp.diagnosis.noise.noise_check import unexpected_noise
from forcegrasp.diagnosis.result import Candidate
from forcegrasp.diagnosis.search.judge import LEAST_GAIN, LEAST_GAIN_AT_FLOOR, judged
from forcegrasp.diagnosis.signatures import Background, chance_of, direction
from forcegrasp.diagnosis.study import Study
from forcegrasp.diagnosis.verdict import LEAST_SHARE, MUCH
from forcegrasp.identify.fit import Fit
from forcegrasp.identify.noise_floor import excess

# Beside effects that leave little its gain must be so many standard errors: a few grasps whose contacts went their own
# way may hold all that is left. What was there gained three or more, what was not 1.4 to 2.0.
_SURE = 2.0
# Fitted to the end, the cost of a rough fit falls by this share of it at most, or of what the effect gained.
_FALLS, _GAINS_MORE = 0.2, 0.1


def least_cost(rough: Fit, without: Fit) -> float:
    """What a rough fit with an effect may come down to at the end, ``without`` being the fit without it."""
    return rough.cost - max(_FALLS * rough.cost, _GAINS_MORE * (without.cost - rough.cost))


class Start:
    """What a step starts from: a fit, and what it leaves.

    Args:
      study: the measurements.
      fit: with the effects that were found so far.
    """

    def __init__(self, study: Study, fit: Fit) -> None:
        self.study, self.fit = study, fit
        self.background = Background(fit, study.numerical)
        self.held = study.heldout(fit)  #: residuals of held-out grasps, ``(G, S, C)``
        self.error = study.error(self.held)
        self.noise = unexpected_noise(self.held, study.numerical, study.target, fit.predicted)
        left = excess(self.held, study.numerical, study.target)
        self.least_gain = LEAST_GAIN if left else LEAST_GAIN_AT_FLOOR
        beside_others = fit.problem.effects and self.error < MUCH and not study.target.gripper.is_servo
        self._least_errors = _SURE if beside_others else 1.0

    def shows(self, candidate: Candidate, least_share: float = LEAST_SHARE) -> bool:
        """Whether noise, or what a few grasps hold, would hardly do as well; see :func:`.evidence.is_significant`."""
        return is_significant(candidate, self.least_gain, least_share, self._least_errors)

    def place(self, candidate: Candidate) -> tuple[bool, float]:
        """What candidates are ordered by: a true effect that explains too little yet must not hide one that does."""
        return not self.shows(candidate), -candidate.heldout_gain

    def best_first(self, candidates: Sequence[Candidate], last: Collection[str] = ()) -> list[Candidate]:
        """Candidates by :meth:`place`, what is outdone by another behind the others, and what adds nothing last.

        Args:
          candidates: in any order.
          last: names of effects that add nothing to one that they contain.
        """
        behind = outdone([c for c in candidates if c.effect.name not in last and self.shows(c)])
        return sorted(candidates, key=lambda c: (c.effect.name in last, c in behind, *self.place(c)))

    def may_be_of_many(self, candidate: Candidate, share_together: float, least: float) -> bool:
        """Whether an effect that explains little is worth a trial: all signatures together must promise enough."""
        return self.shows(candidate, LEAST_SHARE_OF_MANY) and share_together >= least

    def judge(self, refit: Fit, p_family: float, signature: np.ndarray, replaces: str = "") -> Candidate:
        """What held-out grasps say of a fit with one more effect, its last one."""
        return judged(self.study, self.held, refit, refit.effects[-1], p_family, signature, replaces)

    def judge_by_gain(self, refit: Fit, null: np.ndarray, replaces: str = "") -> Candidate:
        """The same of a fit that did not start from a signature."""
        p_family = chance_of(self.fit.cost - refit.cost, null)
        return self.judge(refit, p_family, direction(self.fit, refit), replaces)
