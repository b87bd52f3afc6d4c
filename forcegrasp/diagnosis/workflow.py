"""Diagnoses a set, and adds an effect to a model of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from forcegrasp.diagnosis.refine import refine
from forcegrasp.diagnosis.search import Diagnosis, diagnose
from forcegrasp.diagnosis.signatures import Background, Signatures
from forcegrasp.effects import Effect
from forcegrasp.effects.for_gripper import effect_of, effects_of
from forcegrasp.effects.quantisation import Quantisation
from forcegrasp.errors import ConfigError, MeasurementError
from forcegrasp.identify import workflow
from forcegrasp.identify.cross_validation import heldout_residual, make_folds, rms
from forcegrasp.identify.fit import Fit, Simulators, fit_exactly
from forcegrasp.identify.noise_floor import numerical_error
from forcegrasp.identify.target import Target
from forcegrasp.identify.workflow import Loaded, Progress
from forcegrasp.measure import MeasurementSet
from forcegrasp.models.model_file import Model
from forcegrasp.physics.gripper import Gripper
from forcegrasp.short_repr import ShortRepr

#: A diagnosis needs so many grasps: with fewer, nothing can be held out.
LEAST_GRASPS = 6


def diagnose_set(
    loaded: Loaded[MeasurementSet],
    model: Model | None,
    names: list[str],
    seed: int,
    progress: Progress,
) -> tuple[Diagnosis, Simulators]:
    """Which effects are missing.

    Raises:
      MeasurementError: if there are too few grasps to hold any out.
      ConfigError: if an effect is unknown, or can't show on this gripper.
    """
    if len(loaded.measured.grasps) < LEAST_GRASPS:
        raise MeasurementError(
            f"{loaded.measured.path}: {len(loaded.measured.grasps)} grasps are too few for a diagnosis,"
            f" {LEAST_GRASPS} are needed; record more (forcegrasp record shows a plan)"
        )
    if model is None:
        target, simulators, base = workflow.fit_model(loaded, seed, progress)
    else:
        target, simulators, base = workflow.apply_model(loaded, model, progress, refit=True)
    chosen = chosen_effects(loaded.gripper, names)
    rng = np.random.default_rng(seed + 1)
    return diagnose(target, base, simulators, chosen, rng, progress), simulators


def chosen_effects(gripper: Gripper, names: Sequence[str]) -> list[type[Effect]]:
    """The effects of these names as a gripper has them, in the order in which they act; without names all.

    Raises:
      ConfigError: if one is unknown, or can't show on this gripper.
    """
    wanted = {effect_of(name, gripper).name for name in names}
    return [effect for name, effect in effects_of(gripper).items() if not names or name in wanted]


@dataclass(frozen=True, repr=False)
class Added(ShortRepr):
    """A model with an effect added, against the same model without it."""

    target: Target
    before: Fit
    after: Fit
    error_before: float  #: held-out rms residual ÷ noise
    error_after: float
    model: Model

    def summary(self) -> str:
        return f"error {self.error_before:.2f} → {self.error_after:.2f} × noise, {self.model!r}"


def add_effect(loaded: Loaded[MeasurementSet], model: Model, effect: type[Effect], progress: Progress) -> Added:
    """Fits a model again, without and with one more effect.

    Raises:
      ConfigError: if the model has the effect, or the effect leaves no trace in these data.
    """
    if any(e.effect.name == effect.name for e in model.effects):
        raise ConfigError(f"effect={effect.name}: the model has it already")
    target, simulators, base = workflow.apply_model(loaded, model, progress, refit=True)
    before, folds = base.fit, make_folds(target.grasps)
    progress(
        f"without {effect.name}: {rms(heldout_residual(before, target, folds), target):.3f} × noise on held-out grasps"
    )
    if effect.name == Quantisation.name and any(target.rounding):  # it is in the noise already
        coarse = target.sigma / target.sensor_sigma
        held = heldout_residual(before, target, folds)
        same = workflow.model_of(before, target, loaded, numerical_error(before, target))
        return Added(target, before, before, rms(held * coarse, target), rms(held, target), same)
    background, signatures = Background(before, []), Signatures([effect], target, simulators)
    signatures.simulate(before, [effect])
    scores = [group[0] for group in signatures.scores(before, background, [effect])]
    if not scores:
        raise ConfigError(
            f"effect={effect.name}: leaves no trace in these data at any size; record grasps that show it"
        )
    refined = refine(scores, target, before, simulators, background)
    nearest = min((r.fit for r in refined), key=lambda f: f.cost)
    after = fit_exactly(target, nearest.problem, simulators, nearest.vector)
    error_before, error_after = (rms(heldout_residual(f, target, folds), target) for f in (before, after))
    better = workflow.model_of(after, target, loaded, numerical_error(after, target))
    return Added(target, before, after, error_before, error_after, better)
