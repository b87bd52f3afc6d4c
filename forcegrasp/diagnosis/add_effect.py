"""Adds an effect to a model of a measurement set."""

from __future__ import annotations

from dataclasses import dataclass

from forcegrasp.diagnosis.search.look_beside import look_beside
from forcegrasp.diagnosis.search.refine import refine, refine_anyway
from forcegrasp.diagnosis.signatures import Background, Signatures, trials
from forcegrasp.diagnosis.study import Study
from forcegrasp.effects import Effect
from forcegrasp.errors import ConfigError
from forcegrasp.identify import fit_set
from forcegrasp.identify.base_fit import check_gradient, finished, rms_error
from forcegrasp.identify.cross_validation import make_folds, rms
from forcegrasp.identify.fit import Fit, fit_exactly
from forcegrasp.identify.fitted_model import model_of
from forcegrasp.identify.loading import Loaded
from forcegrasp.identify.noise_floor import numerical_error
from forcegrasp.identify.progress import Progress
from forcegrasp.identify.target import Target
from forcegrasp.measure import MeasurementSet
from forcegrasp.models.model_file import Model
from forcegrasp.physics.sensors import is_rounding
from forcegrasp.short_repr import ShortRepr


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
    target, simulators, base = fit_set.apply_model(loaded, model, progress, refit=True)
    before, study = base.fit, Study(target, simulators, make_folds(target.grasps), progress=progress)
    held = study.heldout(before)
    progress(f"without {effect.name}: {rms(held, target):.3f} × noise on held-out grasps")
    if target.rounding is not None and is_rounding(effect):  # it is in the noise already
        same = model_of(before, target, loaded, numerical_error(before, target))
        return Added(target, before, before, rms(target.before_rounding(held), target), rms(held, target), same)
    background, signatures, tried = Background(before, []), Signatures(study), trials([effect])
    signatures.simulate(before, tried)
    scores = [group[0] for group in signatures.scores(before, background, tried)]
    if not scores:
        raise ConfigError(
            f"effect={effect.name}: leaves no trace in these data at any size; record grasps that show it"
        )
    # the base fit may have made up for the effect, and stand in another valley than it does beside the effect
    rough = [[one.fit for one in refine(scores, study, before, background)], refine_anyway([effect], study, before)]
    starts = [min(fits, key=lambda fit: fit.cost) for fits in rough if fits]
    after = min((_to_the_end(start, study) for start in starts), key=lambda fit: fit.cost)
    better = model_of(after, target, loaded, numerical_error(after, target))
    return Added(target, before, after, rms(held, target), rms(study.heldout(after), target), better)


def _to_the_end(rough: Fit, study: Study) -> Fit:
    """The fit of the model itself that a rough one leads to, brought to its end."""
    target, simulators = study.target, study.simulators
    fit = look_beside(fit_exactly(target, rough.problem, simulators, rough.vector), target, simulators)
    checked = check_gradient(fit, target)
    if checked.converged:
        return fit
    study.progress(f"{rms_error(fit, target):.3f} × noise, and the error still falls")
    return finished(checked, target, simulators).fit
