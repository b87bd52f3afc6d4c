"""Fits with one more effect to the end, from where a rough fit has led, or wherever else that is better."""

from __future__ import annotations

from functools import partial

from forcegrasp.diagnosis.search.look_beside import look_beside
from forcegrasp.diagnosis.search.other_starts import other_starts
from forcegrasp.diagnosis.search.refine import NO_BETTER
from forcegrasp.diagnosis.study import Study
from forcegrasp.identify.base_fit import rms_error
from forcegrasp.identify.fit import Fit, fit_exactly, fit_once
from forcegrasp.identify.led_astray import fit_led_by_others
from forcegrasp.identify.side_by_side import side_by_side
from forcegrasp.identify.target import Target

#: An error of so many times the noise leaves nothing to look for.
ALL_FITTED = 1.05
#: Beyond so many times the noise no start of a fit will find what is left: it is not one effect.
FAR = 10.0


def to_the_end(rough: Fit, study: Study) -> Fit:
    """A fit of the model itself from where a rough one ended.

    Where that leaves more than noise and more than what the set gives, it may have ended where an effect's size meets a
    step of the simulation, or in another valley: then it is led by the grasps that it fits, and starts elsewhere.

    Args:
      rough: with an effect as its last one.
      study: the measurements.
    """
    target, simulators = study.target, study.simulators
    exact = fit_exactly(target, rough.problem, simulators, rough.vector, rough.jacobian)
    exact = look_beside(exact, target, simulators)
    if not _leaves_more(exact, target) or study.given_explains(target, exact):
        return exact
    exact = fit_led_by_others(exact, target, simulators)
    if not _leaves_more(exact, target):
        return exact
    # few grasps tell where else; slopes of all but its last effect hardly change
    some, part = study.on_few(exact)
    known = part.jacobian[..., : part.problem.first_entry(len(part.problem.effects) - 1)]
    rough_fit = partial(fit_once, some.target, part.problem, some.simulators)
    own, *others = side_by_side(
        [
            partial(rough_fit, start, part.correction, rounds=0, known_slopes=known)
            for start in (part.vector, *other_starts(part, some))
        ]
    )
    best = min(others, key=lambda fit: fit.cost, default=own)
    if best.cost > NO_BETTER * own.cost:
        return exact
    again = fit_exactly(target, exact.problem, simulators, exact.moved(best.problem, best.vector))
    return min([exact, again], key=lambda fit: fit.cost)


def _leaves_more(fit: Fit, target: Target) -> bool:
    """Whether a fit leaves more than noise, but not so much that it is hopeless."""
    return ALL_FITTED < rms_error(fit, target) < FAR
