"""A comparison as JSON, as a table for the terminal, and as sections of a report."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from rich import box
from rich.table import Table as Printed
from rich.text import Text as Plain

from forcegrasp.identify.comparison import Cell, Comparison
from forcegrasp.identify.cross_validation import rms, rms_of_grasps
from forcegrasp.identify.noise_floor import at_floor, most_at_floor
from forcegrasp.identify.target import Target
from forcegrasp.reports import between_sets, figures
from forcegrasp.reports.html import Answer, Command, Picture, Section, Table, Text
from forcegrasp.reports.physics_step import short_enough, step_of_scene
from forcegrasp.reports.view import view_section

# Beyond it an error below the floor is excused by the simulation's numerical error, and not by noise.
_MOST_NOISE = 1.2
# Floor ÷ noise from which on the simulation's numerical error is a good part of it.
_ALL_NOISE = 1.1
# Error ÷ noise beyond which a cell is marked.
_MARKED = 2.0
# What the residual is drawn against.
_DRAWN = ("time_since_contact_s", "velocity_m_s", "direction", "force_n", "command_m")
_WORST = 3
#: What the phases of grasps, and those of a servo, are.
PHASE_WORDS = {
    "grasp": "Free: no finger touches; first contact: one finger, or both for less than 0.2 s; both: both press;"
    " hold: both press and the command rests; release: opening, until 0.2 s after.",
    "window": "Moving: the command moves; reversing: it turned round less than 0.2 s ago; holding: it rests for 0.3 s;"
    " released: the motor is switched off.",
}
# Share of the error below which what it goes with is no news.
_WORTH_TELLING = 0.05
# Errors by phase are of all that the model was fitted to: said where held-out ones differ from them by this share.
_OTHERWISE = 0.1
# So is a grasp that, held out, is missed by so many times as much as in the fit.
_ALONE = 2.0
_GOES_WITH = "what it goes with"
#: What single readings are called that no motion explains.
WRONG = "readings that went wrong"


def amount(value: float, unit: str) -> str:
    """A small length, angle or force with its unit."""
    shown, factor = {"m": ("µm", 1e6), "rad": ("mrad", 1e3), "N": ("mN", 1e3)}.get(unit, (unit, 1.0))
    return f"{factor * value:.3g} {shown}" if abs(factor * value) < 1000 else f"{factor * value:.0f} {shown}"


def value_text(value: float, digits: int, at_bound: bool) -> str:
    """A fitted value, marked where it ended at its bound."""
    return f"{value:.{digits}g}" + (" (at its bound)" if at_bound else "")


def words(name: str) -> str:
    """A phase's or signal's name in words."""
    return figures.NAMES.get(name, name.replace("_", " "))


def noise_sentence(target: Target) -> str:
    """The sensor noise that errors are divided by, and where it is from."""
    first = {f"{kind}s": part.start for kind, part in target.axis.kinds.items()}
    sigma, quantum, units = target.sensor_sigma, target.quantum, target.axis.units
    noise = f"sensor noise: {', '.join(f'{kind} {amount(float(sigma[k]), units[k])}' for kind, k in first.items())}"
    steps = [f"{kind} {amount(float(quantum[k]), units[k])}" for kind, k in first.items() if quantum[k]]
    if steps:
        noise += f" (and readings come in steps: {', '.join(steps)}; that adds to the noise)"
    if target.sigma_known:
        return f"{noise}, as given with the set"
    return (
        f"{noise}; not both are given in meta.yaml, so what is missing was estimated from the data. Noise that is slow"
        " looks like motion: the estimate is a lower bound, and so is the floor"
    )


def compare_json(comparison: Comparison, name: str, model: str, notes: list[str]) -> dict[str, Any]:
    """All figures in plain types."""
    cells, target = comparison.cells(), comparison.target
    held = {}
    for k, (signal, unit) in enumerate(zip(target.axis.names, target.axis.units, strict=True)):
        ratio = rms(comparison.heldout, target, np.arange(len(target.axis.names)) == k)
        held[signal] = {f"rms_{unit.lower()}": ratio * target.sigma[k], "ratio": ratio}
    return {
        "set": name,
        "model": model,
        "signals": {signal: _signal_json(comparison, k) for k, signal in enumerate(target.axis.names)},
        "phases": {
            phase: {cell.signal: _cell_json(cell) for cell in cells if cell.phase == phase}
            for phase in comparison.target.phases
            if any(cell.phase == phase for cell in cells)
        },
        "floor_ratio": comparison.floor_ratio(),
        "floor": comparison.floor,
        "heldout": held,
        "noise_given": target.sigma_known,
        "grasps": {g.name: float(e) for g, e in zip(target.grasps, comparison.by_grasp(), strict=True)},
        "recordings": comparison.by_recording(),
        "explained_by": [
            {"covariate": covariate, "signal": kind, "share": share}
            for covariate, kind, share in comparison.explanations()
        ],
        "notes": notes,
        "between_sets": between_sets.between_json(comparison.between) if comparison.between else None,
    }


def _signal_json(comparison: Comparison, k: int) -> dict[str, Any]:
    target, unit = comparison.target, comparison.target.axis.units[k].lower()
    inside, sigma = comparison.residual[..., k][target.mask], float(target.sigma[k])
    ratio = float(np.sqrt(np.mean(inside**2)))
    return {
        f"rms_{unit}": ratio * sigma,
        "ratio": ratio,
        f"bias_{unit}": float(inside.mean()) * sigma,
        f"noise_{unit}": sigma,
        "samples": len(inside),
    }


def _cell_json(cell: Cell) -> dict[str, Any]:
    unit = cell.unit.lower()
    return {f"rms_{unit}": cell.rms, "ratio": cell.ratio, f"bias_{unit}": cell.bias, "samples": cell.samples}


def worst_cell(cells: list[Cell]) -> Cell:
    """The signal and phase with the largest error ÷ noise; a handful of samples does not count."""
    many = [cell for cell in cells if cell.samples >= 40]
    return max(many or cells, key=lambda cell: cell.ratio)


def answer(comparison: Comparison) -> str:
    """Where the model fails, in two sentences."""
    value, floor, cell = comparison.floor_ratio(), comparison.floor, worst_cell(comparison.cells())
    if comparison.heldout is comparison.residual:
        where = "on this set, to which the model was not fitted,"
    elif np.isfinite(comparison.heldout).any():
        where = f"on held-out {comparison.target.part}s"
    else:
        where = f"on the {comparison.target.part}s that it was fitted to (too few to hold any out)"
    error = f"The model's error {where} is {value:.2f} × the sensor noise"
    half, other = comparison.numerical
    cure = "<flag multiccd='disable'/> or rounder pads"
    if 2 * half > other:
        cure = f'<option timestep="{short_enough(step_of_scene(comparison.target.gripper), half):g}"/>'
    own = float(np.sqrt(1 + 4 * half**2 + other**2))  # the floor without what noise makes unsure of the start
    if at_floor(value, floor) and not at_floor(value, _MOST_NOISE):
        cause = "the simulation's own numerical error" if own > _ALL_NOISE else "what is unsure of where windows start"
        better = f"In the gripper's scene, try {cure}" if own > _ALL_NOISE else "Record more moves that start at rest"
        return (
            f"{error}, and up to {floor:.2f} × may be {cause}: this can't tell whether an effect is missing. {better}."
        )
    noise = "noise" if own < _ALL_NOISE else f"noise and the simulation's own error, for which {cure} would be better"
    total = f"{error}; up to {floor:.2f} is {noise}."
    if at_floor(value, floor):
        if round(value, 2) > round(floor, 2):
            near = f"up to {most_at_floor(floor):.2f} is too close to tell from it"
            total = f"{error}; up to {floor:.2f} is {noise}, and {near}."
        return f"{total} These measurements show no failure of the model."
    label, less = comparison.without_worst()
    alone = f" Without {comparison.target.part} {label} it would be {less:.2f}." if at_floor(less, floor) else ""
    return (
        f"{total} It is largest in {words(cell.phase)}, {words(cell.signal)}: {amount(cell.rms, cell.unit)},"
        f" {cell.ratio:.1f} × noise.{alone}"
    )


def answer_box(comparison: Comparison, notes: Sequence[str], commands: Sequence[Command]) -> Answer:
    """The answer as a box: how large the error is, where, how sure that is, and what to do next."""
    rows = [*_rows(comparison), *(("to bear in mind", note) for note in notes)]
    told = [(f"{name[0].upper()}{name[1:]}", f"{text}.") for name, text in rows]
    return Answer(answer(comparison), told, commands=commands)


def printed(comparison: Comparison) -> Printed:
    """Error per phase and signal, for the terminal."""
    table = Printed("phase", box=box.SIMPLE_HEAD, padding=(0, 1))
    names, units = comparison.target.axis.names, comparison.target.axis.units
    for signal in names:
        table.add_column(words(signal))
    cells = {(cell.phase, cell.signal): cell for cell in comparison.cells()}
    for phase in comparison.target.phases:
        row = [cells.get((phase, signal)) for signal in names]
        if any(row):
            table.add_row(words(phase), *(_printed_cell(cell) for cell in row))
    totals = [_signal_json(comparison, k) for k in range(len(names))]
    table.add_section()
    table.add_row(
        "all",
        *(f"{amount(t[f'rms_{u.lower()}'], u)} {t['ratio']:.1f}×" for t, u in zip(totals, units, strict=True)),
    )
    return table


def _printed_cell(cell: Cell | None) -> Plain:
    if cell is None:
        return Plain("–")
    return Plain(f"{amount(cell.rms, cell.unit)} {cell.ratio:.1f}×", "bold" if cell.ratio > _MARKED else "")


def details(comparison: Comparison) -> list[str]:
    """Lines below the table: worst grasps, what the error goes with, and the noise."""
    return [text if name == _GOES_WITH else f"{name}: {text}" for name, text in _rows(comparison)]


def _rows(comparison: Comparison) -> list[tuple[str, str]]:
    """The same as pairs of what is told and its text."""
    errors, target = comparison.by_grasp(), comparison.target
    worst = [f"{target.grasps[i].label} ({errors[i]:.1f} ×)" for i in worst_grasps(comparison)]
    rows = [*_between_rows(comparison), *_recording_rows(comparison), (f"worst {target.part}s", ", ".join(worst))]
    if wrong := wrong_words(comparison):
        rows.append((WRONG, wrong))
    name, kind, share = comparison.explanations()[0]
    if share >= _WORTH_TELLING and not at_floor(comparison.floor_ratio(), comparison.floor):
        rows.append((_GOES_WITH, f"{share:.0%} of the {kind} error goes with {covariate_words(name)}"))
    fitted, held = rms(comparison.residual, target), comparison.floor_ratio()
    if abs(held - fitted) > _OTHERWISE * held:
        rows.append(("errors by phase", f"of the fit to all {target.part}s, {fitted:.2f} × noise in all"))
        rows += _alone_rows(comparison)
    noise, _, sizes = noise_sentence(target).partition(": ")
    return [*rows, (noise, sizes)]


def _alone_rows(comparison: Comparison) -> list[tuple[str, str]]:
    """Which grasp, held out, is missed by far more than in the fit: it shows what no other does."""
    target = comparison.target
    held, fitted = rms_of_grasps(comparison.heldout, target), comparison.by_grasp()
    times = held / np.maximum(fitted, 1.0)
    if target.gripper.is_servo or not np.nanmax(times, initial=0.0) > _ALONE:
        return []
    worst = int(np.nanargmax(times))
    told = f"{target.grasps[worst].label} is missed by {held[worst]:.1f} × noise, {fitted[worst]:.1f} × in the fit to"
    return [("held out", f"{told} all: no other {target.part} shows what it does; record more like it")]


def wrong_words(comparison: Comparison) -> str:
    """Where single readings are that no motion explains, the first few of them; empty if there are none."""
    wrong, axis, told = comparison.wrong_readings(), comparison.target.axis, list[str]()
    if not len(wrong):
        return ""
    for index, sample, signal in wrong[:_WORST].tolist():
        grasp = comparison.target.grasps[index]
        off = abs(float(comparison.residual[index, sample, signal] * comparison.target.sigma[signal]))
        told.append(
            f"{words(axis.names[signal])} at {grasp.time_s[sample]:.4g} s of {grasp.label} by"
            f" {amount(off, axis.units[signal])}"
        )
    more = f", and {len(wrong) - _WORST} more" if len(wrong) > _WORST else ""
    return f"{', '.join(told)}{more}, while those beside fit; look at these rows"


def _between_rows(comparison: Comparison) -> list[tuple[str, str]]:
    """What several sets share, and what not."""
    if comparison.between is None:
        return []
    return [("between the sets", between_sets.answer(comparison.between, comparison.floor))]


def covariate_words(name: str) -> str:
    """A covariate in words."""
    return figures.AXES[name][0].split(" [")[0]


def worst_grasps(comparison: Comparison) -> list[int]:
    """Indices of the grasps with the largest errors, worst first."""
    return [int(i) for i in np.argsort(-comparison.by_grasp())[:_WORST]]


def sections(comparison: Comparison, notes: list[str]) -> list[Section]:
    """What the answer rests on."""
    row = "recording" if comparison.target.recordings else "grasp"
    found = [
        view_section(comparison.target, {"model": comparison.predicted}),
        _by_signal_and_phase(comparison),
        Section(f"Error by {row} and phase", [grid_picture(comparison)]),
        _worst(comparison),
        dependence_section(comparison),
    ]
    if comparison.between is not None:
        found.insert(0, between_sets.section(comparison.between, comparison.floor))
    if notes:
        found.append(Section("To bear in mind", [Text(note) for note in notes]))
    return found


def grid_picture(comparison: Comparison, model: str = "the model") -> Picture:
    """The error of each grasp, or of each of a servo's recordings, in each phase."""
    grid, rows = comparison.by_grasp_and_phase()
    row = "recording" if comparison.target.recordings else "grasp"
    return Picture(
        figures.heat_map(grid, rows, comparison.target.phases),
        f"Error of {model} ÷ sensor noise, of each {row} (rows) in each phase, all signals together. 1 is the noise."
        + (" The worst forty are shown." if len(rows) > 40 else ""),
        in_view=not comparison.target.recordings,
    )


def _recording_rows(comparison: Comparison) -> list[tuple[str, str]]:
    """The error of each of a servo's recordings, where there are several; their loads may differ."""
    found, target = comparison.by_recording(), comparison.target
    if len(found) < 2:
        return []
    rows = []
    for recording, ratios in sorted(found.items(), key=lambda item: -max(item[1].values())):
        signals = zip(ratios.values(), target.sigma.tolist(), target.axis.units, strict=True)
        rows.append(f"{recording} {', '.join(f'{amount(r * sigma, unit)} {r:.1f}×' for r, sigma, unit in signals)}")
    return [("by recording, each held out", "; ".join(rows))]


def _by_signal_and_phase(comparison: Comparison) -> Section:
    cells, names = comparison.cells(), comparison.target.axis.names
    grid = np.full((len(comparison.target.phases), len(names)), np.nan)
    for cell in cells:
        grid[comparison.target.phases.index(cell.phase), names.index(cell.signal)] = cell.ratio
    rows = [
        (
            words(c.signal),
            words(c.phase),
            str(c.samples),
            amount(c.rms, c.unit),
            f"{c.ratio:.2f}",
            amount(c.bias, c.unit),
        )
        for c in cells
    ]
    head = ("signal", "phase", "samples", "rms error", "÷ noise", "mean of measured − model")
    shown = ~np.all(np.isnan(grid), axis=1)
    phases = [words(phase) for phase, there in zip(comparison.target.phases, shown, strict=True) if there]
    return Section(
        "Error by signal and phase",
        [
            Picture(
                figures.heat_map(grid[shown], phases, [words(s) for s in names]),
                f"Error ÷ sensor noise. {PHASE_WORDS[comparison.target.part]}",
                in_view=True,
            ),
            Table(head, rows, frozenset(i for i, cell in enumerate(cells) if cell.ratio > _MARKED)),
            Text(f"S{noise_sentence(comparison.target)[1:]}."),
            Text(
                f"Held-out error {comparison.floor_ratio():.3f} × noise. Floor {comparison.floor:.3f} × noise: sensor"
                " noise, what the simulation's own step and collision code add, and of a servo what is unsure of where"
                " windows start."
            ),
        ],
    )


def _worst(comparison: Comparison) -> Section:
    target, errors = comparison.target, comparison.by_grasp()
    blocks: list = []
    for index in worst_grasps(comparison):
        grasp = target.grasps[index]
        blocks.append(
            Picture(
                figures.overlay(target, index, comparison.predicted[index]),
                f"{target.part.capitalize()} {grasp.label}: error {errors[index]:.2f} × noise. Dots are measured, lines"
                " are the model's; below, measured − model ÷ noise, with a band of ± 2.",
                in_view=True,
            )
        )
    return Section(f"The worst {target.part}s", blocks)


def dependence_section(comparison: Comparison, title: str = "What the error goes with") -> Section:
    """Residuals against what they may depend on."""
    values = {name: value for name, value in comparison.covariates().items() if name in _DRAWN}
    shares = [(n, kind, share) for n, kind, share in comparison.explanations() if share >= 0.01][:8]
    rows = [(covariate_words(name), kind, f"{share:.0%}") for name, kind, share in shares]
    blocks: list = [
        Picture(
            figures.dependence(values, comparison.residual, comparison.target),
            "Measured − model ÷ noise, of all motors: single samples (grey), and the median and the middle 80 % of"
            " equally filled bins (green). Grey band: ± 1. A model that lacks nothing lies flat on 0.",
        )
    ]
    if rows:
        head = ("goes with", "signals", "share of the mean square error that it explains")
        blocks.append(Table(head, rows))
    return Section(title, blocks)
