"""What a diagnosis found, as plain figures: parameters, rankings, and what is left."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from forcegrasp.diagnosis.result import Candidate, Diagnosis, Step
from forcegrasp.effects import Effect
from forcegrasp.identify.comparison import Comparison
from forcegrasp.identify.fit import Fit
from forcegrasp.identify.fitted_model import effects_of_fit
from forcegrasp.identify.intervals import standard_errors, warnings
from forcegrasp.models.model_file import Fitted
from forcegrasp.reports.comparison import worst_cell
from forcegrasp.reports.physics_step import step_warning


def remaining(diagnosis: Diagnosis) -> Comparison:
    """What the final model leaves, as a comparison."""
    fit = diagnosis.fit
    return Comparison(diagnosis.target, fit.predicted, fit.residual, diagnosis.heldout(), diagnosis.floor)


def where(diagnosis: Diagnosis) -> dict[str, Any]:
    """Where the final model's largest error is, what it goes with, and how much of the rest a model could explain."""
    left = remaining(diagnosis)
    cell = worst_cell(left.cells())
    kind = diagnosis.target.axis.kind_of(cell.signal)
    return {
        "phase": cell.phase,
        "signal": cell.signal,
        "ratio": cell.ratio,
        f"rms_{cell.unit.lower()}": cell.rms,
        "explained_by": {name: share for name, of, share in left.explanations() if of == kind},
        "explainable": max(0.0, 1 - 1 / left.floor_ratio() ** 2) if diagnosis.noise is None else 0.0,
    }


def found_steps(diagnosis: Diagnosis) -> list[tuple[Step, Fit]]:
    """The steps that found something, each with the fit that it started from, or of all others found with it."""
    found, fit = [], diagnosis.base.fit
    for step in diagnosis.steps:
        if step.effects:
            best = step.candidates[0] if step.candidates else None
            found.append((step, best.without if best and best.without else fit))
            fit = best.fit if best else fit
    return found


def found_parameters(diagnosis: Diagnosis) -> dict[str, dict[str, Fitted]]:
    """The parameters of all effects in the final model, by effect and by name."""
    fit, target = diagnosis.fit, diagnosis.target
    effects = effects_of_fit(fit, target, standard_errors(fit, target, diagnosis.inexact))
    return {found.effect.name: found.parameters for found in effects}


def candidate_json(candidate: Candidate, diagnosis: Diagnosis) -> dict[str, Any]:
    """An effect that was fitted, in plain types."""
    return {
        "effect": candidate.effect.name,
        "variant": candidate.setting.variant,
        "p_family": candidate.p_family,
        "heldout_gain": candidate.heldout_gain,
        "floor_ratio_after": candidate.error_after,
        "parameters": candidate_parameters(candidate, diagnosis),
    }


def candidate_parameters(candidate: Candidate, diagnosis: Diagnosis) -> dict[str, float]:
    """An effect's parameters: those of the final model if it is in there, and otherwise of its own fit."""
    if candidate.setting.kind not in [known.kind for known in diagnosis.fit.problem.effects]:
        return candidate.parameters()
    return {name: fitted.value for name, fitted in found_parameters(diagnosis)[candidate.effect.name].items()}


def final_warnings(diagnosis: Diagnosis) -> list[str]:
    """What to bear in mind about the final model's parameters."""
    errors, too_long = standard_errors(diagnosis.fit, diagnosis.target, diagnosis.inexact), step_warning(diagnosis)
    return [*([too_long] if too_long else []), *warnings(diagnosis.fit, errors)]


def noise_json(diagnosis: Diagnosis) -> dict[str, Any] | None:
    """The noise of each signal where it is not as assumed; None if there is none."""
    noise = diagnosis.noise
    if noise is None:
        return None
    return {
        signal: {
            "times_stated": float(noise.ratio[k]),
            "core": float(noise.core[k]),
            "heavy_tails": bool(noise.heavy_tails[k]),
            "memory": float(noise.memory[k]),
            "slow_share": float(noise.slow_share[k]),
        }
        for k, signal in enumerate(diagnosis.target.axis.names)
        if noise.affected[k]
    }


def ranking(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """Effects of the first step, best first: those that were refitted, and then those whose signatures were poor."""
    nothing = dict.fromkeys(("p_family", "heldout_gain", "floor_ratio_after", "parameters"))
    rows: list[dict[str, Any]] = []
    for step in diagnosis.steps:
        if step.is_counted:
            values = {name: fitted.value for name, fitted in found_parameters(diagnosis)[step.effects[0]].items()}
            found = nothing | {"floor_ratio_after": step.error_after, "parameters": values}
            rows.append({"effect": step.effects[0], "variant": "", **found})
    first = _first_search(diagnosis)
    if first is None:
        return rows
    rows += [candidate_json(c, diagnosis) for c in first.candidates]
    seen = {row["effect"] for row in rows}
    for score in first.scores:
        name = score.setting.effect.name
        if name not in seen:
            seen.add(name)
            rows.append({"effect": name, "variant": score.setting.variant, **nothing})
    return rows


def no_trace(diagnosis: Diagnosis, tried: Sequence[type[Effect]]) -> list[str]:
    """Effects that change nothing in these grasps at any size, so that nothing can be said about them."""
    first = _first_search(diagnosis)
    if first is None:
        return []
    scored = {score.setting.effect.name for score in first.scores}
    known = {known.effect.name for known in diagnosis.base.fit.problem.effects}
    return [e.name for e in tried if e.name not in scored | known and len(e.trials())]


def _first_search(diagnosis: Diagnosis) -> Step | None:
    return next((step for step in diagnosis.steps if step.scores), None)
