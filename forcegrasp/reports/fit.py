"""A fit, and a fit with an effect added, as JSON, as tables for the terminal, and as sections of a report."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich import box
from rich.table import Table as Printed
from rich.text import Text as Plain

from forcegrasp.diagnosis.add_effect import Added
from forcegrasp.effects import Effect
from forcegrasp.identify.base_fit import BaseFit, rms_error
from forcegrasp.identify.cross_validation import heldout_residual, make_folds, rms, rms_of_grasps
from forcegrasp.identify.fit import Fit
from forcegrasp.identify.intervals import listed, reached_bound
from forcegrasp.identify.target import Target
from forcegrasp.models.model_file import Fitted, Model
from forcegrasp.physics.sensors import is_rounding
from forcegrasp.reports import figures
from forcegrasp.reports.comparison import amount, noise_sentence, value_text, words
from forcegrasp.reports.html import Answer, Command, Picture, Section, Table, Text
from forcegrasp.reports.symptom import symptom_of
from forcegrasp.reports.view import view_section
from forcegrasp.short_repr import as_sentence

#: What to do about a fit that did not converge.
ADVICE = (
    "look at forcegrasp compare for grasps that went wrong, record more grasps, or give the objects' radii and offsets;"
    " other starts: seed=1"
)


@dataclass(frozen=True)
class Row:
    """A parameter of a model."""

    name: str
    fitted: Fitted
    low: float  #: bound
    high: float
    logarithmic: bool
    null: float = float("nan")  #: where an effect's parameter does nothing; base parameters have no such value

    @property
    def text(self) -> str:
        """The value, marked where it ended at its bound."""
        bound = reached_bound(self.fitted.value, self.low, self.high, self.logarithmic, self.null)
        return value_text(self.fitted.value, 4, bound is not None)

    def place(self, value: float) -> float:
        """Where a value lies between the bounds, 0 to 1."""
        low, high, x = (np.log((self.low, self.high, max(value, self.low))) if self.logarithmic
                        else (self.low, self.high, value))  # fmt: skip
        return float((x - low) / (high - low))


def parameter_rows(model: Model) -> Iterator[Row]:
    """Every parameter of a model: of the gripper, of objects, of grasps, of effects."""
    places = [("", model.base)]
    places += [(f" of {o}", values) for o, values in model.objects.items()]
    places += [(f" of grasp {g}", values) for g, values in model.grasps.items()]
    for suffix, values in places:
        for name, fitted in values.items():
            p = model.gripper.parameters[name]
            yield Row(f"{name}{suffix}", fitted, p.low, p.high, p.logarithmic)
    for found in model.effects:
        for p in found.effect.parameters:
            name, fitted = f"{found.effect.name}.{p.name}", found.parameters[p.name]
            yield Row(name, fitted, p.low, p.high, p.logarithmic, p.null)


def parameters_json(model: Model) -> dict[str, Any]:
    """Name → value, 95 % interval and unit."""
    return {
        row.name: {key: getattr(row.fitted, key) for key in ("value", "low", "high", "unit")}
        for row in parameter_rows(model)
    }


def printed_parameters(model: Model, most: int = 20) -> Printed:
    """The parameters, for the terminal; those of single grasps are left to the report."""
    table = Printed("parameter", "value", "95 % interval", "unit", box=box.SIMPLE_HEAD)
    rows = [row for row in parameter_rows(model) if " of grasp " not in row.name]
    for row in rows[:most]:
        table.add_row(*(Plain(text) for text in _texts(row)))
    if len(rows) > most:
        table.add_row(f"… {len(rows) - most} more in the report")
    return table


def _texts(row: Row) -> tuple[str, str, str, str]:
    f = row.fitted
    return row.name, row.text, f"{f.low:.4g} to {f.high:.4g}", "" if f.unit == "1" else f.unit


def parameters_section(model: Model) -> Section:
    """All parameters with their intervals and warnings."""
    rows = list(parameter_rows(model))
    placed = [(r.name, r.place(r.fitted.value), r.place(r.fitted.low), r.place(r.fitted.high)) for r in rows[:60]]
    blocks: list = [Text(f"Warning: {warning}.") for warning in model.warnings]
    blocks += [
        Picture(
            figures.intervals(placed),
            "Fitted values (dots) with 95 % intervals (lines) between the parameters' bounds, on a logarithmic scale"
            " where the parameter has one. Orange: at a bound, or hardly fixed by these data.",
        ),
        Table(("parameter", "value", "95 % interval", "unit"), [_texts(row) for row in rows]),
    ]
    return Section("Parameters", blocks)


def held_out(fit: Fit, target: Target) -> np.ndarray:
    """Residuals of held-out grasps, ``(G, S, C)``."""
    return heldout_residual(fit, target, make_folds(target.grasps))


# --- fit ---------------------------------------------------------------------------------------------------------


def fit_json(base: BaseFit, target: Target, model: Model, name: str, path: Path) -> dict[str, Any]:
    """The fit in plain types."""
    return {
        "set": name,
        "model": str(path),
        "converged": base.converged,
        "reason": base.reason,
        "starts": list(base.errors),
        "error": rms_error(base.fit, target),
        "error_heldout": rms(held_out(base.fit, target), target),
        "parameters": parameters_json(model),
        "warnings": list(model.warnings),
        "noise_given": target.sigma_known,
    }


def fit_answer(base: BaseFit, target: Target) -> str:
    """Whether the fit converged, and how good it is."""
    error, held = rms_error(base.fit, target), rms(held_out(base.fit, target), target)
    errors = f"error {error:.2f} × noise" + (
        f", on held-out {target.part}s {held:.2f} × noise" if np.isfinite(held) else ""
    )
    if base.converged:
        return f"The base model is fitted: {errors}."
    return f"The base model is NOT fitted: {base.reason}. What was reached: {errors}. To do: {ADVICE}."


def model_box(what: str, model: Model, commands: Sequence[Command]) -> Answer:
    """The answer about a fitted model as a box: what, what to bear in mind, and what to do next."""
    return Answer(what, [("To bear in mind", f"{warning}.") for warning in model.warnings], commands=commands)


def fit_sections(base: BaseFit, target: Target, model: Model) -> list[Section]:
    """What the answer rests on."""
    starts = [(str(k), f"{error:.3f}") for k, error in enumerate(base.errors, 1)]
    gate = [
        Table(("start", "error ÷ noise where it ended, on the first grasps of each object"), starts),
        Text(
            f"Largest slope of the error at the end: {base.fit.gradient:.2f} standard errors of a parameter."
            f" {as_sentence(noise_sentence(target))}"
        ),
    ]
    errors = rms_of_grasps(base.fit.residual, target)
    worst = int(np.argmax(errors))
    grasp = target.grasps[worst]
    picture = Picture(
        figures.overlay(target, worst, base.fit.predicted[worst]),
        f"{target.part.capitalize()} {grasp.label}, the worst: error {errors[worst]:.2f} × noise. Dots are measured,"
        " lines are the model's.",
        in_view=True,
    )
    view = view_section(target, {"model": base.fit.predicted})
    return [view, parameters_section(model), Section("Starts", gate), Section(f"The worst {target.part}", [picture])]


# --- add ---------------------------------------------------------------------------------------------------------


def add_json(added: Added, effect: type[Effect], name: str, path: Path) -> dict[str, Any]:
    """The two fits in plain types."""
    return {
        "set": name,
        "model": str(path),
        "effect": effect.name,
        "variant": next((e.variant for e in added.model.effects if e.effect.name == effect.name), ""),
        "error_before": added.error_before,
        "error_after": added.error_after,
        "signals": {signal: {"before": before, "after": after} for signal, before, after in _by_signal(added, effect)},
        "parameters": parameters_json(added.model),
        "warnings": list(added.model.warnings),
        "noise_given": added.target.sigma_known,
    }


def _by_signal(added: Added, effect: type[Effect]) -> list[tuple[str, float, float]]:
    """Held-out error ÷ noise of each signal, before and after."""
    target = added.target
    before, after = held_out(added.before, target), held_out(added.after, target)
    if is_rounding(effect):
        before = target.before_rounding(before)
    one = np.eye(len(target.axis.names), dtype=bool)
    return [(s, rms(before, target, one[k]), rms(after, target, one[k])) for k, s in enumerate(target.axis.names)]


def add_answer(added: Added, effect: type[Effect]) -> str:
    """The fall in one sentence."""
    share = 1 - added.error_after / added.error_before
    return (
        f"With {effect.name} the error on held-out {added.target.part}s falls from {added.error_before:.2f} to"
        f" {added.error_after:.2f} × noise ({share:.0%} less)."
    )


def printed_fall(added: Added, effect: type[Effect]) -> Printed:
    """Errors before and after, for the terminal."""
    table = Printed("held-out error, × noise", "without", "with", box=box.SIMPLE_HEAD)
    for signal, before, after in _by_signal(added, effect):
        table.add_row(words(signal), f"{before:.2f}", f"{after:.2f}")
    table.add_section()
    table.add_row("all", f"{added.error_before:.2f}", f"{added.error_after:.2f}")
    return table


def add_sections(added: Added, effect: type[Effect]) -> list[Section]:
    """What the answer rests on."""
    rows = [(words(signal), before, after) for signal, before, after in _by_signal(added, effect)]
    rows.append(("all", added.error_before, added.error_after))
    fall = Picture(figures.falls(rows), "Errors on grasps held out of the fit, without and with the effect.")
    if is_rounding(effect):
        seen, told = steps_picture(added.target), rounding_words(added.target)
    else:
        seen = symptom_picture(added.target, added.before, added.after, effect)
        told = symptom_of(added.target, added.before, added.after).sentence()
    models = {"base model": added.before.predicted, f"model with {effect.name}": added.after.predicted}
    return [
        view_section(added.target, models),
        Section("Before and after", [fall, Text(as_sentence(noise_sentence(added.target)))]),
        Section(f"What {effect.name} looks like here", [Text(as_sentence(told)), seen]),
        parameters_section(added.model),
    ]


def symptom_picture(target: Target, before: Fit, after: Fit, effect: type[Effect]) -> Picture:
    """The grasp and signal on which an effect lowers the error most, without and with it."""
    seen = symptom_of(target, before, after)
    index, signal = seen.index, seen.channel
    grasp, count = target.grasps[index], target.mask[index].sum()
    errors = [np.sqrt(np.sum(fit.residual[index, :, signal] ** 2) / count) for fit in (before, after)]
    return Picture(
        figures.symptom(target, index, signal, before.predicted[index], after.predicted[index], effect.name),
        f"Where {effect.name} helps most: {words(target.axis.names[signal])} of {target.part} {grasp.label};"
        f" error {errors[0]:.2f} × noise without it, {errors[1]:.2f} × with it. Below: measured − model ÷ noise, band"
        " ± 2.",
    )


def rounding_words(target: Target) -> str:
    """The steps that readings come in."""
    axis = target.axis
    steps = [
        f"{kind}s are multiples of {amount(float(target.quantum[part.start]), axis.units[part.start])}"
        for kind, part in axis.kinds.items()
        if target.quantum[part.start]
    ]
    return f"readings of {listed(steps)}"


def steps_picture(target: Target) -> Picture:
    """Readings that come in steps."""
    forces = target.axis.forces
    signal = forces.start if target.quantum[forces].any() else target.axis.positions.start
    swing = np.ptp(np.where(target.mask, target.signals[..., signal], target.signals[:, :1, signal]), axis=1)
    index = int(np.argmax(swing))
    grasp = target.grasps[index]
    return Picture(
        figures.steps(target, index, signal),
        f"Readings of {words(target.axis.names[signal])} in {target.part} {grasp.name}, where they change fastest: they"
        f" are multiples of {amount(float(target.quantum[signal]), target.axis.units[signal])} (grey lines).",
    )
