"""A law for the unknown: what no effect explains as a sparse sum of terms, judged as effects are."""

from __future__ import annotations

import dataclasses
import re

import numpy as np

from forcegrasp.diagnosis.evidence import LEAST_SHARE_TOGETHER
from forcegrasp.diagnosis.few import with_few
from forcegrasp.diagnosis.found_law import FoundLaw
from forcegrasp.diagnosis.law.law_terms import terms
from forcegrasp.diagnosis.result import Diagnosis
from forcegrasp.diagnosis.search.screen import Screen
from forcegrasp.diagnosis.search.step import look_further
from forcegrasp.diagnosis.study import Study
from forcegrasp.diagnosis.verdict import explains_enough
from forcegrasp.effects.law import Formula, Law, Size, make_law
from forcegrasp.effects.setting import EffectSetting
from forcegrasp.errors import PhysicsError
from forcegrasp.identify.cross_validation import evidence_folds
from forcegrasp.identify.fit import Fit
from forcegrasp.identify.fitted_model import effects_of_fit
from forcegrasp.identify.intervals import standard_errors
from forcegrasp.identify.noise_floor import beyond_fit, excess, numerical_error
from forcegrasp.identify.problem import Problem
from forcegrasp.identify.progress import Progress
from forcegrasp.identify.simulators import Simulators
from forcegrasp.identify.target import Target
from forcegrasp.identify.verdict import Verdict
from forcegrasp.identify.weights import reweigh

#: Most terms of a law.
MOST_TERMS = 3
#: The name of a law that is proposed.
NAME = "proposed_law"
_SYMPTOM = "what no effect of the catalogue explains, as a diagnosis found it"


def find_law(
    diagnosis: Diagnosis, simulators: Simulators, rng: np.random.Generator, progress: Progress
) -> FoundLaw | None:
    """Looks for a law of what a diagnosis leaves; None where it leaves nothing, or nothing that a law explains.

    Where effects were found that explain most of the error, it is one of the rest; where none is the answer, of all
    that the base model leaves.
    """
    unknown = diagnosis.verdict is Verdict.UNKNOWN
    if not (unknown or (diagnosis.verdict.lacks_effects and diagnosis.left)):
        return None
    fit, target = diagnosis.base.fit if unknown else diagnosis.fit, diagnosis.target
    numerical = numerical_error(fit, target)
    study = Study(target, simulators, evidence_folds(target.grasps), beyond_fit(fit, numerical), progress)
    try:
        found = _search(study, fit, rng)
    except PhysicsError as error:
        progress(f"no law: {error}")
        return None
    if found is None:
        return None
    after, target, rivals = found
    before, error = study.error(study.heldout(fit)), study.error(study.heldout(after))
    share = study.explained(study.heldout(fit), study.heldout(after))
    if not explains_enough(share, error, diagnosis.floor, whole_recordings=len(target.recordings) > 1):
        return None
    law, merged = _as_one(fit, after, target)
    errors = standard_errors(merged, target, [*numerical, *diagnosis.by_givens])
    sizes = effects_of_fit(merged, target, errors)[len(fit.problem.effects)]
    return FoundLaw(law, sizes.parameters, rivals, before, error, share, fit, merged)


def _search(study: Study, fit: Fit, rng: np.random.Generator) -> tuple[Fit, Target, tuple[str, ...]] | None:
    """Adds one term after the other for as long as the evidence holds: the fit, what it was fitted to, and rivals."""
    study.progress("looking for a law of what is left")
    library, rivals = list(terms(fit, study.target)), ()
    screen, start = Screen(library, study), fit
    for number in range(MOST_TERMS):
        study = with_few(study, fit)
        step = look_further(study, fit, screen, library, rng, least_promise=LEAST_SHARE_TOGETHER)
        if not step.effects:
            break
        term = step.candidates[0].effect
        assert issubclass(term, Law)
        study.progress(f"found {term.name}: held-out error {step.error_before:.2f} → {step.error_after:.2f} × noise")
        rivals = rivals if number else tuple(_told(name) for name in step.effects[1:])
        target, fit = reweigh(study.target, step.candidates[0].fit, study.simulators)
        study = dataclasses.replace(study, target=target)
        library = [one for one in library if one is not term and _place(one) == _place(term)]
        if not excess(study.heldout(fit), study.numerical, target):
            break
    return None if fit is start else (fit, study.target, rivals)


def _told(name: str) -> str:
    """A term that the data can't tell from another, without its coefficient."""
    place, _, text = name.partition(" ")
    return f"{text.removeprefix('c1 * ')} ({place})"


def _place(term: type[Law]) -> str:
    return term.formula_of.place


def _as_one(before: Fit, after: Fit, target: Target) -> tuple[type[Law], Fit]:
    """The terms of a fit as one law, and the fit with that."""
    first = len(before.problem.effects)
    found = after.effects
    texts: list[str] = []
    sizes: dict[str, Size] = {}
    for number, one in enumerate(found[first:], 1):
        text, formula = _formula(one).expression, _formula(one)
        for name, size in formula.parameters.items():
            new = f"{name.rstrip('1')}{number}"
            text, sizes[new] = re.sub(rf"\b{name}\b", new, text), size
        texts.append(text)
    formula = Formula(place=_formula(found[-1]).place, expression=" + ".join(texts), parameters=sizes, symptom=_SYMPTOM)
    fitted = np.concatenate([one.values for one in found[first:]])
    one = EffectSetting(make_law(NAME, formula, target.gripper), "", fitted)
    problem = Problem(after.problem.gripper, after.problem.grasps, [*found[:first], one])
    starts = {
        name: size.model_copy(update={"value": float(f"{value:.4g}")})
        for (name, size), value in zip(sizes.items(), fitted, strict=True)
    }
    law = make_law(NAME, formula.model_copy(update={"parameters": starts}), target.gripper)
    return law, dataclasses.replace(after, problem=problem)


def _formula(one: EffectSetting) -> Formula:
    assert issubclass(one.effect, Law)
    return one.effect.formula_of
