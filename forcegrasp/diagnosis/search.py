"""Finds out which physical effects a model lacks, one after the other, on evidence from grasps held out of the fit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from forcegrasp.diagnosis.noise_check import Noise, unexpected_noise
from forcegrasp.diagnosis.result import Diagnosis, Step
from forcegrasp.diagnosis.signatures import Signatures
from forcegrasp.diagnosis.step import look_further
from forcegrasp.diagnosis.study import Study
from forcegrasp.diagnosis.verdict import conclude
from forcegrasp.effects import Effect
from forcegrasp.identify.base_fit import BaseFit
from forcegrasp.identify.cross_validation import heldout_residual, make_folds, rms
from forcegrasp.identify.fit import Fit, Simulators
from forcegrasp.identify.noise_floor import beyond_fit, excess, numerical_error, numerical_floor
from forcegrasp.identify.progress import Progress, silent
from forcegrasp.identify.target import Target
from forcegrasp.identify.verdict import Verdict

#: Largest number of effects that are looked for.
MOST_EFFECTS = 6


def diagnose(
    target: Target,
    base: BaseFit,
    simulators: Simulators,
    effects: Sequence[type[Effect]],
    rng: np.random.Generator,
    progress: Progress = silent,
) -> Diagnosis:
    """Adds effects to a fitted base model for as long as the evidence holds.

    Args:
      target: the measurements.
      base: the fitted base model, possibly with effects already in it.
      simulators: of the same grasps.
      effects: the catalogue.
      rng: for the null distribution.
      progress: told what is going on.
    """
    fit, folds = base.fit, tuple(make_folds(target.grasps))
    error_before = rms(target.before_rounding(heldout_residual(fit, target, folds)), target)
    if not base.converged:
        return Diagnosis(Verdict.NOT_FITTED, (), (), base, fit, target, folds, error_before, error_before)
    of_base = numerical_error(fit, target)
    study = Study(target, simulators, folds, beyond_fit(fit, of_base), progress)
    floor = numerical_floor(study.numerical, target)
    steps: list[Step] = []
    if (rounding := target.rounding) is not None:
        progress(f"found {rounding.effect.name}: readings are multiples of one step")
        steps.append(Step((rounding.effect.name,), (), (), error_before, rms(study.heldout(fit), target)))
    signatures = Signatures(effects, study)
    for _ in range(MOST_EFFECTS):
        untried = [e for e in effects if e not in {known.effect for known in fit.problem.effects}]
        if not untried:
            break
        step = look_further(study, fit, signatures, untried, rng)
        steps.append(step)
        if not step.effects:
            break
        fit = step.candidates[0].fit
        progress(f"found {step.effects[0]}: held-out error {step.error_before:.2f} → {step.error_after:.2f} × noise")
        if not _left(study, fit)[0]:
            break
    error_after, (left, noise) = rms(study.heldout(fit), target), _left(study, fit)
    found = [s for s in steps if s.effects]
    verdict = conclude([s.verdict for s in found if s.verdict], error_before, error_after, floor, bool(left))
    names = [s.effects[0] for s in found] if verdict.names_effects else []
    if verdict is Verdict.ONE_OF:
        names += [name for s in found for name in s.effects[1:]]
    of_final = of_base if fit is base.fit else numerical_error(fit, target)
    return Diagnosis(
        verdict, tuple(dict.fromkeys(names)), tuple(steps), base, fit, target, folds, error_before, error_after,
        of_final, floor, left, noise,
    )  # fmt: skip


def _left(study: Study, fit: Fit) -> tuple[str, Noise | None]:
    """Where held-out residuals are more than noise, in words; and the noise, if it is not as assumed."""
    held = study.heldout(fit)
    noise = unexpected_noise(held, study.numerical, study.target, fit.predicted)
    return ("" if noise else excess(held, study.numerical, study.target)), noise
