"""What a diagnosis found, as plain figures: parameters, rankings, and what is left."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from forcegrasp.diagnosis.search import Candidate, Diagnosis, Step
from forcegrasp.effects import Effect
from forcegrasp.effects.for_gripper import effect_of
from forcegrasp.effects.quantisation import Quantisation
from forcegrasp.identify.comparison import Comparison
from forcegrasp.identify.fit import Fit
from forcegrasp.identify.intervals import intervals, standard_errors, warnings
from forcegrasp.reports.comparison import worst_cell


def remaining(diagnosis: Diagnosis) -> Comparison:
    """What the final model leaves, as a comparison."""
    fit = diagnosis.fit
    return Comparison(diagnosis.target, fit.predicted, fit.residual, diagnosis.heldout(), diagnosis.floor)


def where(diagnosis: Diagnosis) -> dict[str, Any]:
    """Where the final model's largest error is, what it goes with, and how much of the rest a model could explain."""
    left = remaining(diagnosis)
    cell = worst_cell(left.cells())
    kind = cell.signal.partition("_")[0]
    return {
        "phase": cell.phase,
        "signal": cell.signal,
        "ratio": cell.ratio,
        f"rms_{cell.unit.lower()}": cell.rms,
        "explained_by": {name: share for name, of, share in left.explanations() if of == kind},
        "explainable": max(0.0, 1 - 1 / left.floor_ratio() ** 2) if diagnosis.noise is None else 0.0,
    }


def found_steps(diagnosis: Diagnosis) -> list[tuple[Step, Fit]]:
    """The steps that found something, each with the fit that it started from."""
    found, fit = [], diagnosis.base.fit
    for step in diagnosis.steps:
        if step.verdict != "none":
            found.append((step, fit))
            fit = step.candidates[0].fit if step.candidates else fit
    return found


def found_parameters(diagnosis: Diagnosis) -> dict[str, dict[str, tuple[float, float, float, str]]]:
    """Value, 95 % interval and unit of the parameters of all effects in the final model."""
    fit = diagnosis.fit
    found: dict[str, dict[str, tuple[float, float, float, str]]] = {}
    errors = standard_errors(fit, diagnosis.numerical)
    for entry, numbers in zip(fit.problem.entries, intervals(fit, errors), strict=True):
        if entry.effect >= 0:
            effect = fit.problem.effects[entry.effect][0].name
            found.setdefault(effect, {})[entry.parameter] = (*numbers, entry.unit)
    if any(diagnosis.target.rounding):
        rounding = effect_of(Quantisation.name, diagnosis.target.gripper)
        steps = zip(rounding.parameters, diagnosis.target.rounding, strict=True)
        found[Quantisation.name] = {p.name: (step, step, step, p.unit) for p, step in steps}
    return found


def candidate_json(candidate: Candidate, diagnosis: Diagnosis) -> dict[str, Any]:
    """An effect that was fitted, in plain types."""
    return {
        "effect": candidate.effect.name,
        "variant": candidate.variant,
        "p_family": candidate.p_family,
        "heldout_gain": candidate.heldout_gain,
        "floor_ratio_after": candidate.error_after,
        "parameters": candidate_parameters(candidate, diagnosis),
    }


def candidate_parameters(candidate: Candidate, diagnosis: Diagnosis) -> dict[str, float]:
    """An effect's parameters: those of the final model if it is in there, and otherwise of its own fit."""
    if (candidate.effect, candidate.variant) not in diagnosis.fit.problem.effects:
        return candidate.parameters()
    return {name: entry[0] for name, entry in found_parameters(diagnosis)[candidate.effect.name].items()}


def final_warnings(diagnosis: Diagnosis) -> list[str]:
    """What to bear in mind about the final model's parameters."""
    return warnings(diagnosis.fit, standard_errors(diagnosis.fit, diagnosis.numerical))


def noise_json(diagnosis: Diagnosis) -> dict[str, Any] | None:
    """The noise of each signal of which it is not what was said; None if there is none."""
    noise = diagnosis.noise
    if noise is None:
        return None
    return {
        signal: {"times_stated": float(times), "core": float(core), "heavy_tails": bool(heavy)}
        for signal, times, core, heavy, unlike in zip(
            diagnosis.target.names, noise.times, noise.core, noise.heavy_tails, noise.unlike, strict=True
        )
        if unlike
    }


def ranking(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """Effects of the first step, best first: those that were refitted, and then those whose signatures were poor."""
    nothing = dict.fromkeys(("p_family", "heldout_gain", "floor_ratio_after", "parameters"))
    rows: list[dict[str, Any]] = []
    for step in diagnosis.steps:
        if step.verdict != "none" and not step.candidates:  # found by counting values, without a fit
            values = {name: entry[0] for name, entry in found_parameters(diagnosis)[step.effects[0]].items()}
            found = nothing | {"floor_ratio_after": step.error_after, "parameters": values}
            rows.append({"effect": step.effects[0], "variant": "", **found})
    first = _first_search(diagnosis)
    if first is None:
        return rows
    rows += [candidate_json(c, diagnosis) for c in first.candidates]
    seen = {row["effect"] for row in rows}
    for score in first.scores:
        if score.effect.name not in seen:
            seen.add(score.effect.name)
            rows.append({"effect": score.effect.name, "variant": score.variant, **nothing})
    return rows


def no_trace(diagnosis: Diagnosis, tried: Sequence[type[Effect]]) -> list[str]:
    """Effects that change nothing in these grasps at any size, so that nothing can be said about them."""
    first = _first_search(diagnosis)
    if first is None:
        return []
    scored = {score.effect.name for score in first.scores}
    known = {effect.name for effect, _ in diagnosis.base.fit.problem.effects}
    return [e.name for e in tried if e.name not in scored | known and len(e.trials())]


def _first_search(diagnosis: Diagnosis) -> Step | None:
    return next((step for step in diagnosis.steps if step.scores), None)
