"""A diagnosis as JSON, as lines for the terminal, and as sections of a report."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from rich import box
from rich.table import Table as Printed
from rich.text import Text as Plain

from forcegrasp.compare import figures
from forcegrasp.compare.advice import Advice
from forcegrasp.compare.compare_output import (
    covariate_words,
    dependence_section,
    noise_sentence,
    words,
    worst_cell,
)
from forcegrasp.compare.comparison import Comparison
from forcegrasp.compare.diagnose import Candidate, Diagnosis, Step
from forcegrasp.compare.fit import Fit
from forcegrasp.compare.fit_output import ADVICE, steps_picture, symptom_picture
from forcegrasp.compare.intervals import intervals, standard_errors
from forcegrasp.compare.report import Picture, Section, Table, Text
from forcegrasp.compare.target import PHASES
from forcegrasp.effects import Effect, get_effect
from forcegrasp.effects.quantisation import Quantisation

_PRINTED = 5


def diagnosis_json(diagnosis: Diagnosis, advice: Advice | None, tried: Sequence[type[Effect]], name: str) -> dict:
    """The diagnosis in plain types."""
    return {
        "set": name,
        "verdict": diagnosis.verdict,
        "effects": list(diagnosis.effects),
        "steps": [_step_json(step) for step in diagnosis.steps],
        "ranking": ranking(diagnosis),
        "no_trace": no_trace(diagnosis, tried),
        "parameters": {
            effect: {p: dict(zip(("value", "low", "high", "unit"), entry, strict=True)) for p, entry in found.items()}
            for effect, found in found_parameters(diagnosis).items()
        },
        "error_before": diagnosis.error_before,
        "error_after": diagnosis.error_after,
        "floor_ratio": diagnosis.error_after,
        "floor": diagnosis.floor,
        "next_grasp": None if advice is None else {
            "grasp": advice.grasp,
            "tells_apart": list(advice.rivals),
            "differences": dict(advice.differences),
            "object": advice.object,
        },
        "where": where(diagnosis),
        "reason": diagnosis.base.reason,
        "noise_given": diagnosis.target.sigma_known,
    }  # fmt: skip


def _step_json(step: Step) -> dict[str, Any]:
    return {
        "verdict": step.verdict,
        "effects": list(step.effects),
        "error_before": step.error_before,
        "error_after": step.error_after,
        "ranking": [_candidate_json(c) for c in step.candidates],
    }


def _candidate_json(candidate: Candidate) -> dict[str, Any]:
    return {
        "effect": candidate.effect.name,
        "variant": candidate.variant,
        "p_family": candidate.p_family,
        "heldout_gain": candidate.heldout_gain,
        "floor_ratio_after": candidate.error_after,
        "parameters": candidate.parameters(),
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
    rows += [_candidate_json(c) for c in first.candidates]
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
        "explainable": max(0.0, 1 - 1 / left.floor_ratio() ** 2),
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
    errors = standard_errors(fit, list(diagnosis.numerical))
    for entry, numbers in zip(fit.problem.entries, intervals(fit, errors), strict=True):
        if entry.effect >= 0:
            effect = fit.problem.effects[entry.effect][0].name
            found.setdefault(effect, {})[entry.parameter] = (*numbers, entry.unit)
    if diagnosis.target.quantum.any():
        steps = zip(Quantisation.parameters, map(float, diagnosis.target.quantum[[0, 2]]), strict=True)
        found[Quantisation.name] = {p.name: (step, step, step, p.unit) for p, step in steps}
    return found


def answer(diagnosis: Diagnosis) -> str:
    """The verdict in words."""
    d, cell = diagnosis, worst_cell(remaining(diagnosis).cells())
    fall = f"The error on held-out grasps falls from {d.error_before:.2f} to {d.error_after:.2f} × the sensor noise"
    found = [step.effects[0] for step, _ in found_steps(d)]
    place = f"{words(cell.signal)}, {words(cell.phase)} ({cell.ratio:.1f} × noise)"
    if d.verdict == "effect":
        rest = "" if not d.left else f" What is left is largest in {place}."
        return f"The model lacks {_list(d.effects, 'and')}. {fall}; up to {d.floor:.2f} is noise.{rest}"
    if d.verdict == "one_of":
        return f"The model lacks {_list(d.effects, 'or')}: these data can't tell which. {fall} with the first of them."
    if d.verdict == "explained":
        return (
            f"The model explains these data: the error on held-out grasps is {d.error_before:.2f} × the sensor noise,"
            f" and up to {d.floor:.2f} is noise and the simulation's own error. They show no missing effect."
        )
    if d.verdict == "unknown":
        best = f" {_list(found, 'and')} would only take it down to {d.error_after:.2f} ×." if found else ""
        return (
            f"Something is missing, and it is none of the effects I know: the error on held-out grasps is"
            f" {d.error_before:.2f} × the sensor noise, and no effect explains it.{best} Look at {place}."
        )
    return f"No diagnosis, for the base model is not fitted: {d.base.reason}. To do: {ADVICE}."


def printed(diagnosis: Diagnosis) -> Printed | None:
    """The best effects of each step, for the terminal."""
    if not any(step.candidates or step.effects for step in diagnosis.steps):
        return None
    table = Printed("", "effect", "gain", "p", "error, × noise", "parameters", box=box.SIMPLE_HEAD)
    for number, step in enumerate(diagnosis.steps, 1):
        if step.effects and not step.candidates:
            fall = f"{step.error_before:.2f} → {step.error_after:.2f}"
            table.add_row(*(Plain(cell, "bold") for cell in (str(number), step.effects[0], "", "", fall, "")))
        for place, candidate in enumerate(step.candidates[:_PRINTED]):
            name, gain, p, values = _texts(candidate)
            cells = ("" if place else str(number), name, gain, p, _error_text(step, candidate), values)
            chosen = candidate.effect.name in step.effects
            table.add_row(*(Plain(cell, "bold" if chosen else "") for cell in cells))
    return table


def _error_text(step: Step, candidate: Candidate) -> str:
    return f"{step.error_before:.2f} → {candidate.error_after:.2f}"


def _texts(candidate: Candidate) -> tuple[str, str, str, str]:
    """Effect, gain, p, parameters."""
    units = {p.name: "" if p.unit == "1" else f" {p.unit}" for p in candidate.effect.parameters}
    values = ", ".join(f"{name} {value:.3g}{units[name]}" for name, value in candidate.parameters().items())
    name = f"{candidate.effect.name} {candidate.variant}".strip()
    return name, f"{candidate.heldout_gain:+.0f}", f"{candidate.p_family:.2g}", values


def lines(diagnosis: Diagnosis, advice: Advice | None) -> list[str]:
    """What stands below the table: symptoms, rivals, what is left, and what to record next."""
    told = []
    for step, _ in found_steps(diagnosis):
        effect = get_effect(step.effects[0])
        told.append(f"{effect.name}: {effect.symptom}")
        told += [f"  it could also be: {_list(step.effects[1:], 'or')}"] if len(step.effects) > 1 else []
    if diagnosis.verdict in ("unknown", "effect", "one_of"):
        told.append(left_sentence(diagnosis))
    if advice is not None:
        told.append(advice.sentence())
    return [*told, noise_sentence(diagnosis.target)]


def left_sentence(diagnosis: Diagnosis) -> str:
    """Where the rest of the error is, in words."""
    rest = where(diagnosis)
    place = f"{words(rest['signal'])}, {words(rest['phase'])}: {rest['ratio']:.1f} × noise"
    if not diagnosis.left:
        return f"what is left is noise; it is largest in {place}"
    name, share = next(iter(rest["explained_by"].items()))
    goes = f", of which {share:.0%} goes with {covariate_words(name)}" if share > 0.05 else ""
    return (
        f"what is left is largest in {place}{goes}; a better model could explain {rest['explainable']:.0%} of the"
        " remaining mean square error at most"
    )


def sections(diagnosis: Diagnosis, advice: Advice | None, tried: Sequence[type[Effect]]) -> list[Section]:
    """What the answer rests on."""
    found = [_step_section(n, *pair, diagnosis) for n, pair in enumerate(found_steps(diagnosis), 1)]
    if advice is not None:
        found.append(_advice_section(diagnosis, advice))
    attempts = [_tried_section(diagnosis, tried)] if diagnosis.steps else []
    left = _left_sections(diagnosis)
    return [*found, *attempts, *left] if diagnosis.effects else [*left, *found, *attempts]


def _step_section(number: int, step: Step, before: Fit, diagnosis: Diagnosis) -> Section:
    effect = get_effect(step.effects[0])
    if step.candidates:
        seen = symptom_picture(diagnosis.target, before, step.candidates[0].fit, effect)
    else:
        seen = steps_picture(diagnosis.target)
    fall = f"Held-out error {step.error_before:.2f} → {step.error_after:.2f} × noise."
    blocks: list = [
        Text(f"Symptom: {effect.symptom}. {fall}", strong=True),
        seen,
    ]
    rows = [
        (name, f"{value:.4g}", f"{low:.4g} to {high:.4g}", "" if unit == "1" else unit)
        for name, (value, low, high, unit) in found_parameters(diagnosis).get(effect.name, {}).items()
    ]
    if rows:
        blocks.append(Table((f"parameter of {effect.name}", "value", "95 % interval", "unit"), rows))
    alone = len(step.candidates) <= 1
    blocks.append(Text("What else it could be:" + (" no other effect comes near." if alone else ""), strong=True))
    blocks += [_candidates_table(step)] if step.candidates else []
    if len(step.effects) > 1:
        blocks.append(Text(f"{_list(step.effects, 'and')} can't be told apart by these data."))
    blocks.append(Text(f"Looks like {_list(effect.look_alikes, 'and')}. What separates them: {effect.separates}."
                       if effect.look_alikes else f"What is its own: {effect.separates}."))  # fmt: skip
    return Section(f"{number}. {' or '.join(step.effects)}", blocks)


def _candidates_table(step: Step) -> Table:
    head = ("effect", "held-out gain", "p (family-wise)", "error ÷ noise", "parameters")
    rows = []
    for c in step.candidates:
        name, gain, p, values = _texts(c)
        rows.append((name, gain, p, _error_text(step, c), values))
    marked = frozenset(i for i, c in enumerate(step.candidates) if c.effect.name in step.effects)
    return Table(head, rows, marked)


def _advice_section(diagnosis: Diagnosis, advice: Advice) -> Section:
    ordered = sorted(advice.differences.items(), key=lambda item: -item[1])
    one, other = advice.rivals
    return Section(
        "What to record next",
        [
            Text(f"{advice.sentence()[0].upper()}{advice.sentence()[1:]}.", strong=True),
            Picture(
                figures.rivals(
                    advice.time_s, advice.command_m, advice.predicted, diagnosis.target.sigma, advice.rivals
                ),
                f"What {one} and {other} predict of the grasp “{advice.grasp}” on {advice.object}.",
            ),
            Table(
                ("grasp", f"difference of {one} and {other} ÷ noise, rms"),
                [(grasp, f"{apart:.2f}") for grasp, apart in ordered],
                frozenset({0}),
            ),
        ],
    )


def _tried_section(diagnosis: Diagnosis, tried: Sequence[type[Effect]]) -> Section:
    rows = []
    for row in ranking(diagnosis):
        gain, p, after = (row[key] for key in ("heldout_gain", "p_family", "floor_ratio_after"))
        texts = ("not refitted", "", "") if gain is None else (f"{gain:+.0f}", f"{p:.2g}", f"{after:.2f}")
        rows.append((row["effect"], get_effect(row["effect"]).stage, *texts))
    silent = no_trace(diagnosis, tried)
    blocks: list = [
        Table(("effect", "acts on", "held-out gain", "p (family-wise)", "error ÷ noise with it"), rows),
        Text(
            "Of the first step, best first. The gain is the change of the log-likelihood of grasps held out of the fit;"
            " p is the probability that the best of all effects does as well on sensor noise alone. Effects whose"
            " signature explains much less than the best one's are not refitted."
        ),
    ]
    if silent:
        blocks.append(Text(f"Leave no trace in these grasps, so nothing can be said about them: {', '.join(silent)}."))
    return Section("All effects that were tried", blocks)


def _left_sections(diagnosis: Diagnosis) -> list[Section]:
    left, target = remaining(diagnosis), diagnosis.target
    worst = int(np.argmax(left.by_grasp()))
    grasp = target.grasps[worst]
    model = "the base model" if not diagnosis.fit.problem.effects else "the final model"
    sentence = left_sentence(diagnosis)
    blocks: list = [
        Text(f"{sentence[0].upper()}{sentence[1:]}."),
        Picture(
            figures.heat_map(left.by_grasp_and_phase(), [f"{g.name} · {g.object}" for g in target.grasps], PHASES),
            f"Error of {model} ÷ sensor noise, of each grasp in each phase. 1 is the noise.",
        ),
        Picture(
            figures.overlay(target, worst, left.predicted[worst]),
            f"Grasp {grasp.name} on {grasp.object}, the worst under {model}: error {left.by_grasp()[worst]:.2f} ×"
            " noise. Dots are measured, lines are the model's.",
        ),
        Text(f"S{noise_sentence(target)[1:]}."),
    ]
    return [Section("What is left", blocks), dependence_section(left, "What the rest goes with")]


def _list(names: Sequence[str], word: str) -> str:
    """a, b and c."""
    *first, last = names
    return f"{', '.join(first)} {word} {last}" if first else last
