"""Effects of which one contains another as a special case: the simplest that the data do not reject is the answer.

An effect that ends where it *is* the simpler one falls back to it. One that fits worse than what it contains has
stalled, and is fitted again from there. And a simple one that was found gives way to one that contains it where that
explains more.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from functools import partial

import numpy as np

from forcegrasp.diagnosis.signatures import sizes_around
from forcegrasp.diagnosis.study import Study
from forcegrasp.effects import Effect
from forcegrasp.effects.base import Nested
from forcegrasp.effects.for_gripper import effect_of
from forcegrasp.effects.setting import EffectSetting
from forcegrasp.identify.fit import Fit, fit_exactly, fit_once
from forcegrasp.identify.predict import predict
from forcegrasp.identify.problem import Problem
from forcegrasp.identify.side_by_side import side_by_side
from forcegrasp.physics.gripper import Gripper

# An effect is the simpler one if what it has beyond it is within so many standard errors of doing nothing.
_STANDARD_ERRORS = 2.0
# This share of a size worth noticing can't be seen.
_NEXT_TO_NOTHING = 1e-3
# A fit has stalled if it is worse than one of what it contains by this share.
_WORSE = 1e-3
# Sizes around the best of those that are tried, so many times as large: first far from it, and then near.
_AROUND = ((0.45, 0.67, 1.4, 1.9, 2.6), (0.8, 0.9, 1.1, 1.25))


def is_richer(effect: type[Effect], than: type[Effect]) -> bool:
    """Whether an effect contains the other one: it leaves less whatever is missing."""
    return than.name in _contained(effect)


def contain(effect: type[Effect], other: type[Effect]) -> bool:
    """Whether one of the two effects contains the other, so that a model needs one of them at most."""
    return is_richer(effect, other) or is_richer(other, effect)


def may_join(effect: type[Effect], others: Collection[type[Effect]]) -> bool:
    """Whether an effect may stand beside others: not one of them, nor what they contain or make meaningless."""
    barred = {name for other in others for name in other.instead_of}
    return effect not in others and effect.name not in barred and not any(contain(effect, other) for other in others)


def look_alike(one: type[Effect], other: type[Effect]) -> bool:
    """Whether the catalogue says of either of two effects that it looks like the other."""
    return one.name in other.look_alikes or other.name in one.look_alikes


def look_alikes_of(
    own: type[Effect], effects: Sequence[type[Effect]], of_any_family: bool = False
) -> list[type[Effect]]:
    """Those of the effects that look like one and are of its family, or of any; no mistakes of the set."""
    return [e for e in effects if look_alike(e, own) and not e.of_set and (of_any_family or e.family == own.family)]


def _contained(effect: type[Effect]) -> set[str]:
    return {nested.effect for nested in effect.contains}


def falls_back(fit: Fit, nested: Nested) -> bool:
    """Whether the last effect of a fit can't be told from a simpler one that it contains.

    A time that is shorter than integrators differ by is none.
    """
    last = len(fit.problem.effects) - 1
    effect = fit.problem.effects[last].effect
    first = fit.problem.first_entry(last)
    errors = np.sqrt(np.diag(fit.covariance())) * np.sqrt(_scale(fit))
    for name, value in nested.at.items():
        index = first + effect.index(name)
        entry, least = fit.problem.entries[index], max(_STANDARD_ERRORS * errors[index], 1e-3)
        if effect.parameters[effect.index(name)].unit == "s":
            step = fit.problem.gripper.integrators_differ_s
            least = max(least, entry.coordinate(value + step) - entry.coordinate(value))
        if abs(fit.vector[index] - entry.coordinate(value)) > least:
            return False
    return True


def is_the_simpler(setting: EffectSetting, nested: Nested) -> bool:
    """Whether an effect of this size is the simpler one, but for what an integrator makes of next to nothing."""
    for name, value in nested.at.items():
        index = setting.effect.index(name)
        parameter = setting.effect.parameters[index]
        apart = setting.values[index] - np.clip(value, parameter.low, parameter.high)
        if abs(apart) > _NEXT_TO_NOTHING * parameter.typical:
            return False
    return True


def fits_as_well(simple: Fit, fit: Fit) -> bool:
    """Whether a fit with the simpler effect leaves no more than falling back to it may cost."""
    return simple.cost <= (1 + _WORSE) * fit.cost + _STANDARD_ERRORS**2 * _scale(fit)


def _scale(fit: Fit) -> float:
    """By what the model's own errors make squared standard errors larger than noise alone does."""
    return max(1.0, float(np.mean((fit.weight * fit.residual) ** 2)))


def simpler(setting: EffectSetting, nested: Nested, gripper: Gripper) -> EffectSetting:
    """The effect that a setting contains, with the values that they share."""
    effect = effect_of(nested.effect, gripper)
    values = effect.typical_values()
    for own, its in nested.same.items():
        values[effect.index(its)] = setting.values[setting.effect.index(own)]
    return EffectSetting(effect, _variant_like(setting, effect), values)


def richer(setting: EffectSetting, container: type[Effect]) -> list[EffectSetting]:
    """Settings of an effect that contains this one: shared values carried over, its own at all sizes that are tried."""
    nested = next(n for n in container.contains if n.effect == setting.effect.name)
    found: dict[bytes, EffectSetting] = {}
    variant = _variant_like(setting, container)
    for trial in [container.typical_values(), *container.trials()]:
        values = np.array(trial, float)
        for own, its in nested.same.items():
            values[container.index(own)] = setting.values[setting.effect.index(its)]
        found[values.tobytes()] = EffectSetting(container, variant, values)
    return list(found.values())


def _variant_like(setting: EffectSetting, effect: type[Effect]) -> str:
    """The variant of an effect that a setting of another one has, or the first where it has none of that name."""
    return setting.variant if setting.variant in effect.variants else effect.variants[0]


def refit_as(setting: EffectSetting, fit: Fit, without: str | Collection[str], study: Study) -> Fit:
    """Fits a model in which this effect takes the place of another, or of several, from where the model stands."""
    return _refit([setting], fit, without, study)


def roughly_as(
    settings: Sequence[EffectSetting],
    fit: Fit,
    without: str | Collection[str],
    study: Study,
    at_the_end: bool = True,
    begin: np.ndarray | None = None,
) -> Fit:
    """The same by the cheap model, from the best of several sizes; each variant is fitted, and the best one returned.

    What a variant leaves where nothing else is fitted yet says little of it.

    Args:
      settings: the effect at these sizes.
      fit, without, study: as for :func:`refit_as`.
      at_the_end: whether slopes are measured where the fit ends, too: not needed if only what it leaves counts.
      begin: coordinates of the fit to begin at, in place of where it stands, ``(p,)``.
    """

    def of_kind(settings: Sequence[EffectSetting]) -> Fit:
        problem, start, slopes = _best_start(settings, fit, without, study, begin)
        return fit_once(
            study.target, problem, study.simulators, start, fit.correction, rounds=0, slopes=slopes,
            at_the_end=at_the_end,
        )  # fmt: skip

    kinds = dict.fromkeys(one.kind for one in settings)
    fits = side_by_side([partial(of_kind, [one for one in settings if one.kind == kind]) for kind in kinds])
    return min(fits, key=lambda one: one.cost)


def refit_as_richer(container: type[Effect], fit: Fit, without: str, study: Study) -> Fit:
    """The same with an effect that contains the other, from the best of its sizes."""
    return _refit(_richer_than(without, container, fit), fit, without, study)


def roughly_as_richer(container: type[Effect], fit: Fit, without: str, study: Study) -> Fit:
    """The same by the cheap model, without slopes where it ends."""
    return roughly_as(_richer_than(without, container, fit), fit, without, study, at_the_end=False)


def _richer_than(name: str, container: type[Effect], fit: Fit) -> list[EffectSetting]:
    return richer(fit.effect(name), container)


def refit_without(names: str | Collection[str], fit: Fit, study: Study) -> Fit:
    """Fits a model that lacks one of the effects, or several, from where the model stands."""
    problem, start, slopes = problem_without(names, fit)
    return fit_exactly(study.target, problem, study.simulators, start, slopes)


def roughly_without(names: str | Collection[str], fit: Fit, study: Study, at_the_end: bool = True) -> Fit:
    """The same by the cheap model; ``at_the_end`` as for :func:`roughly_as`."""
    problem, start, slopes = problem_without(names, fit)
    return fit_once(
        study.target, problem, study.simulators, start, fit.correction, rounds=0, slopes=slopes, at_the_end=at_the_end
    )


def problem_without(names: str | Collection[str], fit: Fit) -> tuple[Problem, np.ndarray, np.ndarray]:
    """The problem without these effects, where the fit stands in it, and its slopes there."""
    kept, places = _without(names, fit)
    return Problem(fit.problem.gripper, fit.problem.grasps, kept), fit.vector[places], fit.jacobian[..., places]


def _without(names: str | Collection[str], fit: Fit) -> tuple[list[EffectSetting], list[int]]:
    """The other effects of a fit, and the indices of all coordinates but those of this one, or of these."""
    case, names = fit.problem.case(fit.vector), {names} if isinstance(names, str) else names
    gone = [i for i, one in enumerate(case.effects) if one.effect.name in names]
    places = [i for i, entry in enumerate(fit.problem.entries) if entry.effect not in gone]
    return [one for one in case.effects if one.effect.name not in names], places


def _refit(settings: Sequence[EffectSetting], fit: Fit, without: str | Collection[str], study: Study) -> Fit:
    problem, start, slopes = _best_start(settings, fit, without, study)
    return fit_exactly(study.target, problem, study.simulators, start, slopes)


def _best_start(
    settings: Sequence[EffectSetting], fit: Fit, without: str | Collection[str], study: Study,
    begin: np.ndarray | None = None,
) -> tuple[Problem, np.ndarray, np.ndarray | None]:  # fmt: skip
    """The problem with the best of some effects in place of others, where to start, and the slopes of what stays."""
    kept, places = _without(without, fit)
    base, slopes = fit.vector[places], fit.jacobian[..., places]
    if begin is not None:
        base, slopes = begin[places], None

    def start_of(setting: EffectSetting) -> tuple[Problem, np.ndarray]:
        problem = Problem(fit.problem.gripper, fit.problem.grasps, [*kept, setting])
        return problem, np.r_[base, problem.start()[len(base) :]]

    def best_of(tried: Sequence[EffectSetting]) -> EffectSetting:
        cases = [problem.case(start) for problem, start in map(start_of, tried)]
        left = map(study.target.residual, predict(study.simulators.cheap, cases))
        return tried[int(np.argmin([float(np.sum((fit.weight * one) ** 2)) for one in left]))]

    best = settings[0]
    if len(settings) > 1:
        best = best_of(settings)
        for times in _AROUND:  # from a size far off, what the others make up for leads elsewhere
            best = best_of([best, *sizes_around(best, times)])
    return *start_of(best), slopes


def extensions(fit: Fit, effects: Sequence[type[Effect]]) -> Iterator[tuple[str, type[Effect]]]:
    """Effects that could take the place of one in the model that they contain: its name, and the effect."""
    for known in fit.problem.effects:
        for effect in effects:
            if is_richer(effect, known.effect):
                yield known.effect.name, effect


def stalled(fit: Fit, member: Fit) -> bool:
    """Whether a fit is worse than one of an effect that it contains."""
    return fit.cost > (1 + _WORSE) * member.cost
