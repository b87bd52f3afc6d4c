"""When held-out grasps speak for an effect, and when they can't tell two effects apart."""

from __future__ import annotations

import numpy as np

from forcegrasp.diagnosis.result import Candidate

#: Family-wise probability of a false alarm that is accepted at each step.
ALARM = 0.01
#: An effect must lower the error of some signal in some phase by this share; by more where all is at the floor already.
LEAST_GAIN, LEAST_GAIN_AT_FLOOR = 0.02, 0.1
#: An effect must explain this share of the mean square beyond the noise.
LEAST_SHARE = 0.25
# Effects whose signatures are that parallel can't be told apart, whatever the likelihood says.
_PARALLEL = 0.995
# An effect with fewer parameters that gains this share of what the best one gains can't be ruled out.
_NEARLY = 0.95


def is_significant(candidate: Candidate, least_gain: float) -> bool:
    """Whether noise would hardly do as well: ``least_gain`` is the share by which some signal's error must fall."""
    gains = candidate.gains[np.isfinite(candidate.gains)]
    spread = gains.std(ddof=1) * np.sqrt(len(gains)) if len(gains) > 1 else np.inf
    return (
        candidate.p_family <= ALARM
        and gains.sum() > max(spread, 5.0)
        and candidate.largest_fall >= least_gain
        and candidate.share >= LEAST_SHARE
    )


def indistinguishable(winner: Candidate, other: Candidate) -> bool:
    """Whether these data can't tell another effect from the best one."""
    lead = winner.gains - other.gains
    lead = lead[np.isfinite(lead)]
    error = lead.std(ddof=1) * np.sqrt(len(lead)) if len(lead) > 1 else np.inf
    parallel = abs(float(winner.signature @ other.signature))
    simpler = len(other.effect.parameters) < len(winner.effect.parameters)
    nearly = simpler and other.heldout_gain > _NEARLY * winner.heldout_gain
    return other.heldout_gain > 0 and (lead.sum() <= error or parallel > _PARALLEL or nearly)
