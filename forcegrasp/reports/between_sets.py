"""What several sets share and in which parameters they differ: in words, as a table, as JSON, as part of a report."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rich import box
from rich.table import Table as Printed
from rich.text import Text as Plain

from forcegrasp.diagnosis.verdict import MUCH
from forcegrasp.identify.between_sets import Agreement, Between, BetweenSets
from forcegrasp.identify.intervals import listed
from forcegrasp.models.model_file import Fitted
from forcegrasp.reports import figures
from forcegrasp.reports.html import Picture, Section, Table, Text
from forcegrasp.short_repr import counted, some

# Parameters that the terminal, and the figure, have room for.
_PRINTED, _DRAWN = 20, 24
_LEAST_P = 1e-4
_WORDS = {Agreement.DIFFERS: "differs", Agreement.SHARED: "no difference found", Agreement.UNCLEAR: "can't be told"}


def answer(between: BetweenSets, floor: float) -> str:
    """In which parameters the sets differ, and whether that can be relied on."""
    differ, shared, unclear = (between.of(one) for one in Agreement)
    said = []
    if differ:
        values = [f"{one.name} ({_values(one)}; p {_p(one)})" for one in differ[:3]]
        more = [counted(len(differ) - 3, "more")] if len(differ) > 3 else []
        said.append(f"the sets differ in {listed([*values, *more])}")
    if shared:
        said.append(f"no difference was found in {counted(len(shared), 'other parameter' if differ else 'parameter')}")
    if unclear:
        said.append(f"{some(one.name for one in unclear)} can't be told: {unclear[0].reason}")
    worst = max(between.sets, key=lambda one: one.error)
    doubt = (
        f". The model leaves {worst.error:.2f} × noise in {worst.name} alone: what it lacks may pass for a difference,"
        " or hide one; diagnose first"
    )
    return ("; ".join(said) or "they have no parameter in common") + (doubt if worst.error > MUCH * floor else "")


def printed(between: BetweenSets) -> Printed:
    """The parameters in each set, for the terminal, those that differ first."""
    head, rows = _table(between, brief=True)
    table = Printed(box=box.SIMPLE_HEAD, padding=(0, 1))
    for name in head:
        table.add_column(Plain(name))
    for row in rows[:_PRINTED]:
        table.add_row(*map(Plain, row))
    if len(rows) > _PRINTED:
        table.add_row(f"… {len(rows) - _PRINTED} more in the report")
    return table


def section(between: BetweenSets, floor: float) -> Section:
    """The same as a figure and a table."""
    ordered, told = _ordered(between), answer(between, floor)
    panels = [figures.Forest(_named(o), o.values, o.shared, o.agreement is Agreement.DIFFERS) for o in ordered[:_DRAWN]]
    more = f" The first {_DRAWN} of {len(ordered)} parameters." if len(ordered) > _DRAWN else ""
    errors = "; ".join(f"{one.name} {one.error:.2f} × noise" for one in between.sets)
    marked = frozenset(i for i, one in enumerate(ordered) if one.agreement is Agreement.DIFFERS)
    return Section(
        "Between the sets",
        [
            Text(f"{told[0].upper()}{told[1:]}."),
            Picture(
                figures.forest(panels),
                "Each set fitted by itself: values (dots) with 95 % intervals (lines); and the value of all sets, where"
                f" there is one (diamond). Orange: differs.{more}",
            ),
            Table(*_table(between), marked),
            Text(f"Error of the model fitted to each set by itself: {errors}."),
        ],
    )


def between_json(between: BetweenSets) -> dict[str, Any]:
    """All figures in plain types."""
    return {
        "sets": [
            {"set": one.name, "error": one.error, "converged": one.base.converged, "reason": one.base.reason}
            for one in between.sets
        ],
        "parameters": {one.name: _json(one) for one in between.parameters},
    }


def _json(one: Between) -> dict[str, Any]:
    return {
        "unit": one.unit,
        "agreement": one.agreement,
        "reason": one.reason,
        "values": {name: _numbers(fitted) for name, fitted in one.values.items()},
        "ratios" if one.is_ratio else "differences": {n: _numbers(fitted) for n, fitted in one.differences.items()},
        "p": one.p,
        "p_corrected": one.p_corrected,
        "shared": _numbers(one.shared),
        "std_of_log_between_sets" if one.is_ratio else "std_between_sets": _numbers(one.spread),
    }


def _numbers(fitted: Fitted | None) -> dict[str, float] | None:
    return fitted and {"value": fitted.value, "low": fitted.low, "high": fitted.high}


def _ordered(between: BetweenSets) -> list[Between]:
    return [one for kind in (Agreement.DIFFERS, Agreement.UNCLEAR, Agreement.SHARED) for one in between.of(kind)]


def _table(between: BetweenSets, brief: bool = False) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Head and rows; a brief table has no intervals of single sets, and differences of two sets only."""
    names, several = [one.name for one in between.sets], any(one.spread for one in between.parameters)
    columns: dict[str, Callable[[Between], str]] = {"parameter": _named}
    columns |= {name: lambda one, name=name: _value(one.values.get(name), brief) for name in names}
    if not (several and brief):
        columns["÷ or − the first's"] = _differences
    if several:
        columns |= {"all sets": lambda one: _interval(one.shared), "std between sets": _spread}
    columns |= {"p": _p, "": lambda one: _WORDS[one.agreement] + (f", {one.reason}" if one.reason else "")}
    return tuple(columns), [tuple(cell(one) for cell in columns.values()) for one in _ordered(between)]


def _value(fitted: Fitted | None, brief: bool) -> str:
    return f"{fitted.value:.4g}" if fitted and brief else _interval(fitted)


def _differences(one: Between) -> str:
    sign = "× {:.4g}" if one.is_ratio else "{:+.3g}"
    return "; ".join(_interval(d, sign) for d in one.differences.values())


def _spread(one: Between) -> str:
    form = "{:.1%}" if one.is_ratio else "{:.2g}"
    return _interval(one.spread, form, form)


def _named(one: Between) -> str:
    return one.name if one.unit in ("", "1") else f"{one.name} [{one.unit}]"


def _values(one: Between) -> str:
    return ", ".join(f"{fitted.value:.4g} in {name}" for name, fitted in one.values.items())


def _interval(fitted: Fitted | None, form: str = "{:.4g}", bound: str = "{:.4g}") -> str:
    if fitted is None:
        return "–"
    return f"{form.format(fitted.value)} ({bound.format(fitted.low)} to {bound.format(fitted.high)})"


def _p(one: Between) -> str:
    if one.reason:
        return "–"
    return f"{one.p_corrected:.2g}" if one.p_corrected >= _LEAST_P else f"< {_LEAST_P:g}"
