"""What held-out grasps say of an effect."""

from __future__ import annotations

import numpy as np

from forcegrasp.diagnosis.evidence import LEAST_RISE, is_beyond_chance
from forcegrasp.diagnosis.result import Candidate
from forcegrasp.diagnosis.study import Study
from forcegrasp.effects.setting import EffectSetting
from forcegrasp.identify.cross_validation import rms
from forcegrasp.identify.fit import Fit
from forcegrasp.identify.noise_floor import cells
from forcegrasp.identify.target import Target

#: An effect must lower the error of some signal in some phase by this share; by more where all is at the floor already.
LEAST_GAIN, LEAST_GAIN_AT_FLOOR = 0.02, 0.1


def judged(
    study: Study, held: np.ndarray, fit: Fit, setting: EffectSetting, p_family: float, signature: np.ndarray,
    replaces: str = "",
) -> Candidate:  # fmt: skip
    """An effect with its evidence.

    Args:
      study: the measurements.
      held: residuals of held-out grasps without the effect, ``(G, S, C)``.
      fit: with the effect.
      setting: the effect in it.
      p_family, signature, replaces: see :class:`.Candidate`.
    """
    target, after = study.target, study.heldout(fit)
    gains = study.gains(held, after)
    recordings = study.of_recordings(gains)
    sums = np.array([one.sum() for one in recordings]) if recordings else None
    harms = any(is_beyond_chance(-one, LEAST_RISE) for one in recordings)
    fall = largest_fall(target, held, after)
    error, share = study.error(after), study.explained(held, after)
    return Candidate(setting, fit, p_family, gains, error, share, fall, signature, replaces, sums, harms)


def largest_fall(target: Target, held: np.ndarray, after: np.ndarray) -> float:
    """Share by which the error falls in the signal and phase where it falls most, from residuals to others."""
    return max((1 - rms(after, target, w) / rms(held, target, w) for _, w in cells(target)), default=0.0)
