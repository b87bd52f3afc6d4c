"""Radii and places that a set gives, fitted within their tolerance beside all effects, from before the search on."""

from __future__ import annotations

import dataclasses

import numpy as np
from scipy.stats import chi2

from forcegrasp.diagnosis.evidence import LEAST_SHARE_TOGETHER
from forcegrasp.diagnosis.faults.fault import besides
from forcegrasp.diagnosis.faults.odd_grasps import coordinates_by_name
from forcegrasp.diagnosis.faults.suspects import leaves_nothing
from forcegrasp.diagnosis.faults.tolerance import MOST, RULER_M, Moved
from forcegrasp.diagnosis.faults.wrong_radii import most_radii, moved_as_fault
from forcegrasp.diagnosis.givens.doubt import with_fault
from forcegrasp.diagnosis.givens.givens_besides import Fitted
from forcegrasp.diagnosis.result import Diagnosis
from forcegrasp.diagnosis.verdict import explained_share
from forcegrasp.identify.base_fit import ended
from forcegrasp.identify.cross_validation import rms
from forcegrasp.identify.fit import Fit, fit_exactly, fit_once
from forcegrasp.identify.givens import Given
from forcegrasp.identify.loading import Loaded
from forcegrasp.identify.problem import Problem
from forcegrasp.identify.progress import Progress
from forcegrasp.identify.simulators import Simulators
from forcegrasp.measure import MeasurementSet

# They are fitted, and told as moved, if chance alone would hardly ever take as much off what is left.
_CHANCE = 1e-4
# It shows before any effect is found if it takes this share off what the base model leaves beyond the noise.
_AT_ONCE = 0.05


def with_fitted_givens(
    loaded: Loaded[MeasurementSet], said: Fitted, progress: Progress
) -> tuple[Loaded[MeasurementSet], Fitted] | None:
    """The set with radii and places to be fitted, and its base model; None if they explain little, or are wrong.

    Where they are a little off in many grasps, what is left of each hides small effects, and others that are not there
    take their part: fitted beside all else, they take it themselves. Radii that are off by more than the set says, some
    more and some less, are fitted as if a ruler had measured them: it may not have said that one did.

    Args:
      loaded: the set as it is.
      said: the same, fitted.
      progress: told what is going on.
    """
    target, _, base = said
    if loaded.gripper.is_servo or leaves_nothing(base.fit, target) or not base.starts_agree:
        return None
    progress("fitting radii and places within their tolerance")
    measured, std_m = loaded.measured, loaded.measured.radius_std_m
    fit = _with_priors(measured, said, std_m)
    if fit is not None and std_m < RULER_M and _moved(fit, std_m).radii_apart():
        progress("fitting radii as if a ruler had measured them")
        fit, std_m = _with_priors(measured, said, RULER_M), RULER_M
        if fit is not None and _moved(fit, std_m).smaller_m:  # it may be an effect
            return None
    if fit is None or not _moved(fit, std_m).is_within:
        return None
    grasps = fit.problem.grasps
    target, simulators = dataclasses.replace(target, grasps=grasps), Simulators(fit.problem)
    measured = dataclasses.replace(measured, grasps=grasps, radius_std_m=std_m)
    loaded = dataclasses.replace(loaded, measured=measured)
    return loaded, (target, simulators, ended(fit, target, simulators, base.errors, hasty=True))


def _with_priors(measured: MeasurementSet, said: Fitted, radius_std_m: float) -> Fit | None:
    """The base model with radii, given with this standard deviation, and places; None if they explain little."""
    target, _, base = said
    fitted_m = (radius_std_m, measured.offset_std_m)
    grasps = tuple(dataclasses.replace(grasp, fitted_m=fitted_m) for grasp in measured.grasps)
    problem = Problem(target.gripper, grasps)
    if not len(problem.priors):
        return None
    start = coordinates_by_name(problem, (base.fit.problem, base.fit.vector))
    fit = fit_once(dataclasses.replace(target, grasps=grasps), problem, Simulators(problem), start)
    return None if _does_as_well(base.fit, fit) else fit


def told_as_moved(found: Diagnosis, loaded: Loaded[MeasurementSet], said: Fitted) -> Diagnosis | None:
    """The diagnosis of a set whose radii and places were fitted, with where they were put, or with them as given.

    As given where nothing asks for another place: then nothing else need be less certain for it. Radii that are beyond
    their tolerance, some more and some less, are wrong where that leaves nothing, or effects explain most of what was
    left and a ruler could not be so far off; None if that is not so, and something is beyond its tolerance. Where
    effects explain most, something may be left, and places, and radii by what a ruler may be off, may be beyond it:
    they make up for whatever else differs, such as another contact, or a delay that is not steady. Effects stand beside
    the base model of the set as it is, which users go on with.

    Args:
      found: the diagnosis.
      loaded: the set as it is.
      said: the same, fitted.
    """
    (target, _, base), measured = said, loaded.measured
    all_of_them = len(found.target.grasps) == len(target.grasps)
    shows_at_once = all_of_them and _shows_at_once(said, found.base.fit)
    most = found.verdict.names_effects and _explained(found) >= LEAST_SHARE_TOGETHER
    if found.verdict.names_effects and all_of_them:
        found = dataclasses.replace(found, base=base)
    # from where they are given: without the effects they may have gone where no slope leads back from
    as_given = _fitted_again(found, (0.0, 0.0))
    if _does_as_well(as_given.fit, found.fit):
        return as_given
    tolerances = measured.radius_std_m, measured.offset_std_m
    if any(grasp.fitted_m != tolerances for grasp in found.target.grasps):
        as_exact_as_said = _fitted_again(as_given, tolerances)
        found = as_exact_as_said if _does_as_well(as_exact_as_said.fit, found.fit) else found
    moved = _moved(found.fit, measured.radius_std_m)
    radii, places = (_of(moved, kind).is_within for kind in ("radius_m", "offset_m"))
    # where the time is over what was found is told, wherever the set was put
    if not found.stopped and (not radii or not (places or most)):
        wrong = most_radii(loaded, moved)
        if wrong is None or (found.left and not most) or found.fault is not None or not places:
            return None
        # by less than a ruler may be off they may make up for what is left
        if not found.left or moved.most_of_radii_m > MOST * RULER_M:
            return with_fault(found, wrong.told_by(found.fit), (target, base.fit))
    if found.fault is not None and (timing := found.fault.moved) is not None:
        moved = Moved((*timing.numbers, *moved.numbers), np.r_[timing.deviations, moved.deviations])
    first = found.fault if found.fault is not None and found.fault.moved is None else None
    fault = moved_as_fault(loaded if first is None else first.put_right, moved)
    fault = fault if first is None else besides(first, fault)
    if shows_at_once:
        return with_fault(found, fault, (target, base.fit))
    return dataclasses.replace(found, fault=fault, error_moved=found.error_of_base)


def _does_as_well(fit: Fit, other: Fit) -> bool:
    """Whether a fit leaves no more than one in which more of what is given is open, but for chance (Wilks 1938)."""
    return bool(fit.cost - other.cost < chi2.isf(_CHANCE, len(other.problem.priors)))


def _explained(found: Diagnosis) -> float:
    """Share of what the base model leaves beyond the noise that effects explain."""
    return explained_share(found.error_of_base, found.error_after, noise=found.floor)


def _of(moved: Moved, kind: str) -> Moved:
    """Only what was moved of radii, or of places."""
    where = [index for index, number in enumerate(moved.numbers) if number.kind == kind]
    return Moved(tuple(moved.numbers[index] for index in where), moved.deviations[where])


def _fitted_again(found: Diagnosis, fitted_m: tuple[float, float]) -> Diagnosis:
    """The diagnosis with its model fitted to radii and places with these standard deviations, metres; 0 as given."""
    grasps = tuple(dataclasses.replace(grasp, fitted_m=fitted_m) for grasp in found.target.grasps)
    target = dataclasses.replace(found.target, grasps=grasps)
    problem = Problem(found.fit.problem.gripper, grasps, found.fit.effects)
    start = coordinates_by_name(problem, (found.fit.problem, found.fit.vector))
    fit = fit_exactly(target, problem, Simulators(problem), start)
    base = found.base if found.base.fit is not found.fit else dataclasses.replace(found.base, fit=fit)
    found = dataclasses.replace(found, fit=fit, base=base, target=target)
    return dataclasses.replace(found, error_after=rms(found.heldout(), target))


def _shows_at_once(said: Fitted, fitted: Fit) -> bool:
    """Whether what was moved takes something off what the base model leaves, before any effect is found."""
    target, _, base = said
    return base.fit.cost - fitted.cost > _AT_ONCE * target.beyond_noise(base.fit.residual)


def _moved(fit: Fit, radius_std_m: float) -> Moved:
    """Where a fit puts what is given and fitted all the same, if radii are given with this standard deviation."""
    numbers, deviations = list[Given](), list[float]()
    for entry, value in zip(fit.problem.entries, fit.values.tolist(), strict=True):
        if entry.precision:
            grasp = fit.problem.grasps[int(np.flatnonzero(entry.members)[0])]
            owner = grasp.object if entry.parameter == "radius_m" else grasp.name
            std = radius_std_m if entry.parameter == "radius_m" else entry.std
            numbers.append(Given(entry.parameter, owner, std, entry.members))
            deviations.append((value - entry.start) / std)
    return Moved(tuple(numbers), np.array(deviations))
