"""A law that a diagnosis proposes, as words, as JSON and as a section of its report."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from forcegrasp.diagnosis.found_law import FoundLaw
from forcegrasp.diagnosis.law.law_terms import along
from forcegrasp.identify.intervals import listed
from forcegrasp.identify.target import Target
from forcegrasp.reports import figures
from forcegrasp.reports.html import Picture, Section, Table, Text
from forcegrasp.short_repr import as_sentence

_PLACES = {
    "motor": "a force on the motors", "command": "a shift of the command",
    "position": "a part of the position readings", "force": "a part of the force readings",
}  # fmt: skip


def law_words(found: FoundLaw) -> str:
    """The law and what it explains, in a sentence."""
    place = _PLACES[found.law.formula_of.place]
    rivals = f"; it could also be {listed(found.rivals, 'or')}" if found.rivals else ""
    return (
        f"a law explains {found.share:.0%} of that: {found.equation}, {place} ({_numbers(found)}); the held-out error"
        f" falls from {found.error_before:.2f} to {found.error_after:.2f} × noise{rivals}. It is a formula that"
        " fits, and no cause that is known"
    )


def _numbers(found: FoundLaw) -> str:
    return ", ".join(
        f"{name} {p.value:.4g}{_unit(p.unit)}, 95 %: {p.low:.4g} to {p.high:.4g}"
        for name, p in found.parameters.items()
    )


def _unit(unit: str) -> str:
    return f" {unit}" if unit else ""


def law_json(found: FoundLaw | None) -> dict[str, Any] | None:
    """The law in plain types; None without one."""
    if found is None:
        return None
    formula = found.law.formula_of
    return {
        "equation": found.equation,
        "place": formula.place,
        "expression": formula.expression,
        "parameters": {name: dataclasses.asdict(fitted) for name, fitted in found.parameters.items()},
        "explained_share": found.share,
        "error_before": found.error_before,
        "error_after": found.error_after,
        "could_also_be": list(found.rivals),
    }


def law_section(found: FoundLaw, target: Target) -> Section:
    """The law, its numbers, and the residual over what it adds."""
    values = np.array([fitted.value for fitted in found.parameters.values()])
    added = along(found.law, values, found.before, target)
    rows = [(n, f"{p.value:.4g}", f"{p.low:.4g} to {p.high:.4g}", p.unit) for n, p in found.parameters.items()]
    words = law_words(found)
    picture = figures.law(added, found.before.residual, found.after.residual, target, found.equation)
    return Section(
        "A law for what is left",
        [
            Text(as_sentence(words), strong=True),
            Picture(
                picture,
                "Measured − model ÷ noise without the law (grey: single samples; green: their median and middle 80 %)"
                " over what the law adds there, and what it changes of the prediction (the other line).",
            ),
            Table(("number", "value", "95 % interval", "unit"), rows),
            Text("law.yaml beside this report holds it: name it, edit it, and add it to a model."),
        ],
    )
