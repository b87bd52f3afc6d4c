"""Whether what effects leave may be that the gripper's act in another form.

Friction is no formula, nor is play, or a finger that bends: an effect that is there differs from the catalogue's by
some share of what it does. What another one would explain within that share can't be told from it, unless that one
explains all of it.
"""

from __future__ import annotations

import numpy as np

from forcegrasp.diagnosis.study import Study
from forcegrasp.identify.fit import Fit
from forcegrasp.identify.noise_floor import excess
from forcegrasp.identify.predict import Case, predict

#: Share of what an effect does that its form may be off by.
FORM_TOLERANCE = 0.15


def done_by_each(study: Study, fit: Fit) -> np.ndarray:
    """What each effect in a model changes of the signals ÷ noise, all else as it is, ``(effects, G, S, C)``."""
    case = fit.problem.case(fit.vector)
    less = [Case(case.base, tuple(e for e in case.effects if e is not one)) for one in case.effects]
    own, *others = predict(study.rough or study.simulators.cheap, [case, *less])
    return np.array([study.target.change(own, other) for other in others]).reshape(-1, *own.shape)


def may_be_forms(study: Study, fit: Fit) -> bool:
    """Whether what held-out grasps show, in every signal and phase, is within the tolerance of the effects' forms.

    A servo's log is never called that: of a real drive much is left after the largest effect, and motions that are
    held out as wholes show what of it another one explains.
    """
    if study.target.gripper.is_servo or not fit.problem.effects:
        return False
    tolerated = FORM_TOLERANCE * np.sqrt(np.sum(done_by_each(study, fit) ** 2, axis=0))
    return not excess(study.heldout(fit), study.numerical, study.target, tolerated)
