"""A diagnosis as JSON, as lines for the terminal, and as sections of a report."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np
from rich import box
from rich.table import Table as Printed
from rich.text import Text as Plain

from forcegrasp.diagnosis.advice import Advice
from forcegrasp.diagnosis.faults.fault import Fault
from forcegrasp.diagnosis.result import NOTHING, Candidate, Diagnosis, Step, taken_over_by
from forcegrasp.effects import Effect
from forcegrasp.effects.for_gripper import effect_of
from forcegrasp.identify.cross_validation import rms
from forcegrasp.identify.fit import Fit
from forcegrasp.identify.intervals import listed, reached_bound
from forcegrasp.identify.noise_floor import AT_FLOOR
from forcegrasp.identify.verdict import Verdict
from forcegrasp.reports import figures
from forcegrasp.reports.comparison import (
    WRONG,
    dependence_section,
    grid_picture,
    noise_sentence,
    value_text,
    words,
    worst_cell,
    wrong_words,
)
from forcegrasp.reports.diagnosis_words import (
    besides_sentence,
    fault_words,
    is_of_labels,
    is_only_moved,
    jitter_sentence,
    lacks,
    left_out_words,
    left_sentence,
    left_share,
    noise_words,
    odd_words,
    preference,
    recordings_sentence,
    row_sentence,
    shares_sentence,
    stopped_words,
)
from forcegrasp.reports.findings import (
    candidate_json,
    candidate_parameters,
    final_warnings,
    found_parameters,
    found_steps,
    no_trace,
    noise_json,
    ranking,
    remaining,
    where,
)
from forcegrasp.reports.fit import ADVICE, rounding_words, steps_picture, symptom_picture
from forcegrasp.reports.html import Picture, Section, Table, Text
from forcegrasp.reports.law import law_json, law_section, law_words
from forcegrasp.reports.physics_step import shorter_step
from forcegrasp.reports.symptom import symptom_of
from forcegrasp.reports.view import view_section
from forcegrasp.short_repr import as_sentence

_PRINTED = 5


def diagnosis_json(diagnosis: Diagnosis, advice: Advice | None, tried: Sequence[type[Effect]], name: str) -> dict:
    """The diagnosis in plain types."""
    return {
        "set": name,
        "answer": answer(diagnosis),
        "verdict": diagnosis.verdict,
        "stopped": diagnosis.stopped,
        "effects": list(diagnosis.effects),
        "preferred": list(diagnosis.preferred),
        "explained_share": diagnosis.explained,
        "shares": diagnosis.shares(),
        "left_share": left_share(diagnosis) if diagnosis.shares() else None,
        "fault": _fault_json(diagnosis.fault),
        "law": law_json(diagnosis.law),
        "odd_grasps": [dataclasses.asdict(grasp) for grasp in diagnosis.odd],
        "left_out": [dataclasses.asdict(grasp) for grasp in diagnosis.left_out],
        "alone": diagnosis.alone,
        "may_be_forms": diagnosis.may_be_forms,
        "uneven_noise": diagnosis.is_uneven_noise,
        "clock_jitter": None if diagnosis.clock_jitter is None else dataclasses.asdict(diagnosis.clock_jitter),
        "steps": [_step_json(step, diagnosis) for step in diagnosis.steps],
        "ranking": ranking(diagnosis),
        "no_trace": no_trace(diagnosis, tried),
        "parameters": {
            effect: {name: dataclasses.asdict(fitted) for name, fitted in found.items()}
            for effect, found in found_parameters(diagnosis).items()
        },
        "error_before": diagnosis.error_before,
        "error_moved": diagnosis.error_moved,
        "error_after": diagnosis.error_after,
        "floor_ratio": diagnosis.error_after,
        "floor": diagnosis.floor,
        "floor_of_model": diagnosis.floor_of_model,
        "next_grasp": None if advice is None else {
            **advice.next_grasp.model_dump(),
            "tells_apart": list(advice.rivals),
            "differences": dict(advice.differences),
            "bits": advice.bits[advice.grasp],
        },
        "where": where(diagnosis),
        "reason": diagnosis.base.reason,
        "noise_given": diagnosis.target.sigma_known,
        "noise": noise_json(diagnosis),
        "warnings": final_warnings(diagnosis),
    }  # fmt: skip


def _fault_json(fault: Fault | None) -> dict[str, Any] | None:
    if fault is None:
        return None
    then = _fault_json(fault.then)
    return {"name": fault.name, "words": fault.words, "check": fault.check, "moved": fault.moved_by, "then": then}


def _step_json(step: Step, diagnosis: Diagnosis) -> dict[str, Any]:
    return {
        "verdict": step.verdict or NOTHING,
        "effects": list(step.effects),
        "preferred_because": preference(step),
        "error_before": step.error_before,
        "error_after": step.error_after,
        "ranking": [candidate_json(c, diagnosis) for c in step.candidates],
    }


def answer(diagnosis: Diagnosis) -> str:
    """The verdict in words."""
    of_model, of_set = _of_model(diagnosis), fault_words(diagnosis)
    alone = f"Only {diagnosis.alone} shows more: look at it." if diagnosis.alone else ""
    # what was moved within its tolerance is no fault, and comes after the verdict
    model_first = diagnosis.fault_is_rival or is_only_moved(diagnosis)
    parts = (of_model, of_set) if model_first else (of_set, of_model)
    return " ".join(filter(None, (stopped_words(diagnosis), *parts, alone, left_out_words(diagnosis))))


def _missed_objects(d: Diagnosis) -> str:
    """Why held-out error is left though nothing is missing; empty if none is."""
    fitted = rms(d.fit.residual, d.target)
    if d.left or d.noise is not None or d.error_after < AT_FLOOR * max(d.floor, fitted):
        return ""
    return (
        f" A fit of all {d.target.part}s leaves {fitted:.2f} ×: where few are left to fit an"
        " object by, those held out are missed."
    )


def _of_model(diagnosis: Diagnosis) -> str:
    d, cell, noise = diagnosis, worst_cell(remaining(diagnosis).cells()), noise_words(diagnosis)
    found = listed([*(d.fault.names if d.verdict is Verdict.DATA and d.fault else []), *d.preferred] or [""])
    place = f"{words(cell.signal)}, {words(cell.phase)} ({cell.ratio:.1f} × noise)"
    if is_of_labels(d):
        return lacks(d)
    if d.verdict.names_effects:
        change = f"from {d.error_of_base:.2f} to {d.error_after:.2f} ×"
        with_found = f"{found} put right" if d.verdict is Verdict.DATA else found
        fall = f"With {with_found} the error on held-out {d.target.part}s falls {change}"
        rest = f"What is left is largest in {place}." if d.left else noise
        told = " ".join(filter(None, (lacks(d), shares_sentence(d))))
        return f"{told} {fall} the sensor noise; up to {d.floor:.2f} is noise. {rest}".rstrip() + _missed_objects(d)
    if d.verdict is Verdict.EXPLAINED:
        of_noise = f"the error on held-out {d.target.part}s is {d.error_after:.2f} × the sensor noise"
        if noise:
            return f"The model explains these data: they show no missing effect; {of_noise}. {noise}"
        return (
            f"The model explains these data: {of_noise}, and up to {d.floor:.2f} is noise and the simulation's own"
            f" error. They show no missing effect.{_missed_objects(d)}"
        )
    if d.verdict is Verdict.UNKNOWN:
        best = f"{found} would only take it down to {d.error_after:.2f} ×" if found else "no effect explains it"
        if d.stopped and not found:
            best = f"up to {d.floor:.2f} is noise"
        missing = "Something is missing, and it is none of the effects I know"
        if d.stopped:
            missing = "Something is missing"
        if d.is_uneven_noise:
            missing += ", or the noise grows with speed or force"
        if shorter_step(d) is not None:
            missing += ", as far as the scene's physics step lets me tell"
        return (
            f"{missing}: the error on held-out {d.target.part}s is"
            f" {d.error_of_base:.2f} × the sensor noise, and {best}. Look at {place}."
        )
    return f"No diagnosis, for the base model is not fitted: {d.base.reason}. To do: {ADVICE}."


def printed(diagnosis: Diagnosis) -> Printed | None:
    """The best effects of each step, for the terminal."""
    if not any(step.candidates or step.effects for step in diagnosis.steps):
        return None
    table = Printed("", "effect", "gain", "p", "error, × noise", "parameters", box=box.SIMPLE_HEAD)
    for number, step in enumerate(diagnosis.steps, 1):
        if step.is_counted:
            fall = f"{step.error_before:.2f} → {step.error_after:.2f}"
            table.add_row(*(Plain(cell, "bold") for cell in (str(number), step.effects[0], "", "", fall, "")))
        # what was tried last, and made held-out grasps worse, only puzzles
        shown = [c for c in step.candidates if step.effects or c.heldout_gain > 0]
        for place, candidate in enumerate(shown[:_PRINTED]):
            name, gain, p, values = _texts(candidate, diagnosis)
            cells = ("" if place else str(number), name, gain, p, _error_text(step, candidate), values)
            chosen = candidate.effect.name in step.effects
            table.add_row(*(Plain(cell, "bold" if chosen else "") for cell in cells))
    return table


def _error_text(step: Step, candidate: Candidate) -> str:
    return f"{step.error_before:.2f} → {candidate.error_after:.2f}"


def _texts(candidate: Candidate, diagnosis: Diagnosis) -> tuple[str, str, str, str]:
    """Effect, gain, p, parameters."""
    found = candidate_parameters(candidate, diagnosis)
    values = ", ".join(
        f"{p.name} {_value(candidate.effect, p.name, found[p.name], 3)}{'' if p.unit == '1' else f' {p.unit}'}"
        for p in candidate.effect.parameters
    )
    return candidate.setting.title, f"{candidate.heldout_gain:+.0f}", f"{candidate.p_family:.2g}", values


def _value(effect: type[Effect], name: str, value: float, digits: int) -> str:
    p = next(p for p in effect.parameters if p.name == name)
    return value_text(value, digits, reached_bound(value, p.low, p.high, p.logarithmic, p.null) is not None)


def lines(diagnosis: Diagnosis, advice: Advice | None) -> list[str]:
    """What stands below the table: symptoms, rivals, what is left, and what to record next."""
    text: list[str] = []
    if is_of_labels(diagnosis):  # the fit was led astray, and what it says of the gripper is nothing to go by
        return [noise_sentence(diagnosis.target)]
    for step, before in found_steps(diagnosis):
        effect = effect_of(step.effects[0], diagnosis.target.gripper)
        text.append(f"{effect.name}: {_symptom(step, before, diagnosis)}")
        text += [f"  {line}" for line in _final_texts(diagnosis, effect)]
        text += [f"  it could also be: {listed(step.effects[1:], 'or')}"] if len(step.effects) > 1 else []
    if diagnosis.odd and diagnosis.steps:
        text.append(f"look at these first: {odd_words(diagnosis)}")
    if wrong := wrong_words(remaining(diagnosis)):
        text.append(f"{WRONG}: {wrong}")
    if row := row_sentence(diagnosis):
        text.append(row)
    if diagnosis.verdict is Verdict.UNKNOWN or diagnosis.verdict.names_effects:
        text.append(left_sentence(diagnosis))
    besides = (jitter_sentence(diagnosis), besides_sentence(diagnosis), recordings_sentence(diagnosis))
    text += [more for more in besides if more]
    if diagnosis.law is not None:
        text.append(law_words(diagnosis.law))
    elif diagnosis.law_sought and diagnosis.left:
        text.append("a law was looked for: no formula of what the model knows explains half of what is left")
    if advice is not None:
        text.append(advice.sentence())
    return [*text, noise_sentence(diagnosis.target), *(f"warning: {warning}" for warning in final_warnings(diagnosis))]


def _symptom(step: Step, before: Fit, diagnosis: Diagnosis) -> str:
    """What an effect that was found changes in these data, in words."""
    if step.is_counted:
        return rounding_words(diagnosis.target)
    seen = symptom_of(diagnosis.target, before, step.candidates[0].fit).sentence()
    later = taken_over_by(step, diagnosis.steps)
    return f"{seen} (later {later} took its place)" if later else seen


def _final_texts(diagnosis: Diagnosis, effect: type[Effect]) -> list[str]:
    """Each parameter of an effect in the final model, with its interval."""
    return [
        f"{name} {_value(effect, name, p.value, 4)}{'' if p.unit == '1' else f' {p.unit}'}"
        f" (95 %: {p.low:.4g} to {p.high:.4g})"
        for name, p in found_parameters(diagnosis).get(effect.name, {}).items()
    ]


def sections(diagnosis: Diagnosis, advice: Advice | None, tried: Sequence[type[Effect]]) -> list[Section]:
    """What the answer rests on."""
    found = [_step_section(n, *pair, diagnosis) for n, pair in enumerate(found_steps(diagnosis), 1)]
    if advice is not None:
        found.append(_advice_section(diagnosis, advice))
    attempts = [_tried_section(diagnosis, tried)] if diagnosis.steps else []
    left, view = _left_sections(diagnosis), _view(diagnosis)
    left += [law_section(diagnosis.law, diagnosis.target)] if diagnosis.law is not None else []
    return [view, *found, *attempts, *left] if diagnosis.effects else [view, *left, *found, *attempts]


def _view(diagnosis: Diagnosis) -> Section:
    """The base model's predictions beside those of the final model."""
    models = {"base model": diagnosis.base.fit.predicted}
    if diagnosis.fit is not diagnosis.base.fit:
        added = listed(diagnosis.preferred) if diagnosis.preferred else "what the set gives moved"
        models[f"model with {added}"] = diagnosis.fit.predicted
    return view_section(diagnosis.target, models)


def _step_section(number: int, step: Step, before: Fit, diagnosis: Diagnosis) -> Section:
    effect = effect_of(step.effects[0], diagnosis.target.gripper)
    if step.is_counted:
        seen = steps_picture(diagnosis.target)
    else:
        seen = symptom_picture(diagnosis.target, before, step.candidates[0].fit, effect)
    fall = f"Held-out error {step.error_before:.2f} → {step.error_after:.2f} × noise."
    told = _symptom(step, before, diagnosis)
    blocks: list = [
        Text(f"{as_sentence(told)} {fall}", strong=True),
        seen,
        Text(f"What is known of {effect.name}: {effect.symptom}."),
    ]
    rows = [
        (name, _value(effect, name, p.value, 4), f"{p.low:.4g} to {p.high:.4g}", "" if p.unit == "1" else p.unit)
        for name, p in found_parameters(diagnosis).get(effect.name, {}).items()
    ]
    if rows:
        blocks.append(Table((f"parameter of {effect.name}", "value", "95 % interval", "unit"), rows))
    alone = len(step.candidates) <= 1
    blocks.append(Text("What else it could be:" + (" no other effect comes near." if alone else ""), strong=True))
    blocks += [_candidates_table(step, diagnosis)] if step.candidates else []
    if len(step.effects) > 1:
        blocks.append(Text(f"{listed(step.effects, 'and')} can't be found apart by these data."))
    blocks.append(Text(f"Looks like {listed(effect.look_alikes, 'and')}. What separates them: {effect.separates}."
                       if effect.look_alikes else f"What is its own: {effect.separates}."))  # fmt: skip
    return Section(f"{number}. {' or '.join(step.effects)}", blocks)


def _candidates_table(step: Step, diagnosis: Diagnosis) -> Table:
    values = "parameters (of effects in the final model: there; of others: as fitted in this step)"
    head = ("effect", "held-out gain", "p (family-wise)", "error ÷ noise", values)
    rows = []
    for c in step.candidates:
        name, gain, p, values = _texts(c, diagnosis)
        rows.append((name, gain, p, _error_text(step, c), values))
    marked = frozenset(i for i, c in enumerate(step.candidates) if c.effect.name in step.effects)
    return Table(head, rows, marked)


def _advice_section(diagnosis: Diagnosis, advice: Advice) -> Section:
    ordered = sorted(advice.differences.items(), key=lambda item: (item[0] != advice.grasp, -item[1]))
    one, other = advice.rivals
    return Section(
        "What to record next",
        [
            Text(as_sentence(advice.sentence()), strong=True),
            Picture(
                figures.rivals(diagnosis.target, advice.time_s, advice.command_m, advice.predicted, advice.rivals),
                f"What {one} and {other} predict of the grasp “{advice.grasp}” on {advice.next_grasp.object}.",
            ),
            Table(
                ("grasp", f"difference of {one} and {other} ÷ noise, rms", "expected to tell, bits of 1"),
                [(grasp, f"{apart:.2f}", f"{advice.bits[grasp]:.2f}") for grasp, apart in ordered],
                frozenset({0}),
            ),
        ],
    )


def _tried_section(diagnosis: Diagnosis, tried: Sequence[type[Effect]]) -> Section:
    rows = []
    for row in ranking(diagnosis):
        gain, p, after = (row[key] for key in ("heldout_gain", "p_family", "floor_ratio_after"))
        texts = ("not refitted", "", "") if gain is None else (f"{gain:+.0f}", f"{p:.2g}", f"{after:.2f}")
        rows.append((row["effect"], effect_of(row["effect"], diagnosis.target.gripper).stage, *texts))
    silent = no_trace(diagnosis, tried)
    blocks: list = [
        Table(("effect", "acts on", "held-out gain", "p (family-wise)", "error ÷ noise with it"), rows),
        Text(
            "Of the first step, best first. The gain is the change of the log-likelihood of what was held out of the"
            " fit; p is the probability that the best of all effects does as well on sensor noise alone. Effects whose"
            " signature explains much less than the best one's are not refitted."
        ),
    ]
    if silent:
        blocks.append(
            Text(
                f"Leave no trace in these {diagnosis.target.part}s, so nothing can be said about them:"
                f" {', '.join(silent)}."
            )
        )
    return Section("All effects that were tried", blocks)


def _left_sections(diagnosis: Diagnosis) -> list[Section]:
    left, target = remaining(diagnosis), diagnosis.target
    worst = int(np.argmax(left.by_grasp()))
    grasp = target.grasps[worst]
    model = "the base model" if not diagnosis.fit.problem.effects else "the final model"
    blocks: list = [
        Text(as_sentence(left_sentence(diagnosis))),
        grid_picture(left, model),
        Picture(
            figures.overlay(target, worst, left.predicted[worst]),
            f"{target.part.capitalize()} {grasp.label}, the worst under {model}: error {left.by_grasp()[worst]:.2f} ×"
            " noise. Dots are measured, lines are the model's.",
            in_view=True,
        ),
        Text(as_sentence(noise_sentence(target))),
    ]
    return [Section("What is left", blocks), dependence_section(left, "What the rest goes with")]
