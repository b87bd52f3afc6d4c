"""A diagnosis as lines for the terminal, and as sections of a report."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from rich import box
from rich.table import Table as Printed
from rich.text import Text as Plain

from forcegrasp.diagnosis.advice import Advice
from forcegrasp.diagnosis.result import Candidate, Diagnosis, Step, taken_over_by
from forcegrasp.effects import Effect
from forcegrasp.effects.for_gripper import effect_of
from forcegrasp.identify.fit import Fit
from forcegrasp.identify.intervals import listed, reached_bound
from forcegrasp.identify.verdict import Verdict
from forcegrasp.reports import figures
from forcegrasp.reports.comparison import (
    WRONG,
    dependence_section,
    grid_picture,
    noise_sentence,
    value_text,
    wrong_words,
)
from forcegrasp.reports.diagnosis_words import (
    besides_sentence,
    is_of_labels,
    jitter_sentence,
    left_sentence,
    odd_words,
    recordings_sentence,
    row_sentence,
)
from forcegrasp.reports.findings import (
    candidate_parameters,
    final_warnings,
    found_parameters,
    found_steps,
    no_trace,
    ranking,
    remaining,
)
from forcegrasp.reports.fit import rounding_words, steps_picture, symptom_picture
from forcegrasp.reports.html import Picture, Section, Table, Text
from forcegrasp.reports.law import law_section, law_words
from forcegrasp.reports.symptom import symptom_of
from forcegrasp.reports.view import view_section
from forcegrasp.short_repr import as_sentence

_PRINTED = 5


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
