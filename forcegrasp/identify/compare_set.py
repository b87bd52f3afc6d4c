"""Holds a model against a measurement set."""

from __future__ import annotations

from forcegrasp.identify import fit_set
from forcegrasp.identify.comparison import Comparison
from forcegrasp.identify.cross_validation import heldout_residual, make_folds
from forcegrasp.identify.fitted_model import model_of
from forcegrasp.identify.loading import Loaded
from forcegrasp.identify.noise_floor import beyond_fit, numerical_error, numerical_floor
from forcegrasp.identify.progress import Progress
from forcegrasp.measure import MeasurementSet
from forcegrasp.models.model_file import Model


def compare(
    loaded: Loaded[MeasurementSet], model: Model | None, seed: int, progress: Progress
) -> tuple[Comparison, Model, list[str]]:
    """Where a model fails; without one, where the base model fails after fitting it."""
    if model is None:
        target, _, base = fit_set.fit_model(loaded, seed, progress)
        notes = [] if base.converged else [f"the base model is not fitted: {base.reason}"]
    else:
        target, _, base = fit_set.apply_model(loaded, model, progress, refit=False)
        notes = []
    fit, same = base.fit, model is None or model.data.get("fingerprint") == loaded.measured.fingerprint
    # a model that has not seen this set is tested on all of it
    held = heldout_residual(fit, target, make_folds(target.grasps)) if same else fit.residual
    numerical = numerical_error(fit, target)
    floor = numerical_floor(beyond_fit(fit, numerical), target)
    comparison = Comparison(target, fit.predicted, fit.residual, held, floor)
    return comparison, model or model_of(fit, target, loaded, numerical), notes
