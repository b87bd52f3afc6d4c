"""Few grasps that stand for all where a rough answer will do: which effects to fit, and where from."""

from __future__ import annotations

import dataclasses

import numpy as np

from forcegrasp.diagnosis.noise.stray_readings import without_spikes
from forcegrasp.diagnosis.study import Few, Study
from forcegrasp.identify.fit import Fit
from forcegrasp.identify.simulators import Simulators, cheap_tier
from forcegrasp.identify.target import Target
from forcegrasp.replay.replay import Replay

# Share of each object's grasps that are few; but no fewer than so many in all.
_SHARE, _LEAST = 1 / 3, 6
# Grasps with less than this share of the error that is usual for so many don't show what is left, if that is more than
# so many standard deviations of the noise's squares.
_BLIND, _CHANCE = 0.5, 4.0


def with_few(study: Study, fit: Fit) -> Study:
    """The study with few grasps that show what a fit leaves; the ones that it has, if they do."""
    if study.few is not None and not _are_blind(study.few.keep, study.target, fit):
        return study
    keep = few_grasps(study.target, fit)
    if len(keep) == len(study.target.grasps):
        return study
    exact, problem = study.simulators.one_model, fit.subset(keep).problem
    simulators = Simulators(problem, exact)
    tier = cheap_tier(problem.gripper, "screening")
    rough = simulators.cheap if exact else Replay(problem.gripper, problem.grasps, tier)
    return dataclasses.replace(study, few=Few(keep, simulators, rough))


def few_grasps(target: Target, fit: Fit) -> np.ndarray:
    """Indices of a third of each object's grasps, or of each recording's windows; of at least six in all.

    The one that a fit leaves most of is among them, not counting spikes; the others are spread over all.
    """
    squares = np.sum((fit.weight * without_spikes(fit.residual)) ** 2, axis=(1, 2))
    owner = np.array([g.session if target.gripper.is_servo else g.object for g in target.grasps])
    share = min(1.0, max(_SHARE, _LEAST / len(owner)))
    chosen: list[int] = []
    for name in dict.fromkeys(owner):
        members = np.flatnonzero(owner == name)
        count = int(np.ceil(share * len(members)))
        worst = members[np.argmax(squares[members])]
        spread = members[np.linspace(0, len(members) - 1, count).round().astype(int)]
        chosen += [worst, *(m for m in spread if m != worst)][:count]
    return np.sort(chosen)


def _are_blind(keep: np.ndarray, target: Target, fit: Fit) -> bool:
    """Whether these grasps show much less than others of what a fit leaves."""
    beyond = target.beyond_noise(fit.residual)
    usual = beyond * len(keep) / len(target.grasps)
    few = target.subset(keep).beyond_noise(fit.subset(keep).residual)
    return beyond > _CHANCE * np.sqrt(2 * target.readings) and few < _BLIND * usual
