"""The analysis of a table of final forces as JSON, as lines for the terminal, and as sections of a report."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from forcegrasp.final_force.analysis import TableAnalysis
from forcegrasp.final_force.causes import CAUSES, MENU, NO_TRACE, Onset, grasps_for
from forcegrasp.final_force.shapes import Candidate, rms
from forcegrasp.identify.verdict import Verdict
from forcegrasp.reports.figures import plain
from forcegrasp.reports.html import Picture, Section, Table, Text
from forcegrasp.short_repr import counted

_LAW = "force = kp f_α Δq, through 0, one f_α per object"
_MARKS = ("o", "s", "^", "v", "D", "P", "X", "*")  # of sessions
_COLOURS = ("#2c6fbb", "#c7622b", "#3a8f5c", "#8a5bb0", "#777777")


def compare_json(analysis: TableAnalysis) -> dict:
    """The base law's errors in plain types: of the fit, and of rows left out."""
    signals = _errors(analysis, analysis.base, "residual")
    return {
        "set": analysis.table.name,
        "model": _LAW,
        "signals": {"final_force": signals},
        "phases": {"hold": {"final_force": {key: signals[key] for key in ("rms_n", "ratio")}}},
        "floor_ratio": _ratio(analysis, analysis.base),
        "heldout": {"final_force": _errors(analysis, analysis.base, "left_out")},
    }


def diagnosis_json(analysis: TableAnalysis) -> dict:
    """The verdict, and every effect that makes one of the shapes that were tried, best first, in plain types."""
    before, after = _ratio(analysis, analysis.base), _ratio(analysis, analysis.best)
    step = {
        "verdict": analysis.verdict,
        "effects": list(analysis.effects),
        "shapes": list(analysis.found),
        "error_before": before,
        "error_after": after,
    }
    grasps = next_grasps(analysis)
    return {
        "verdict": analysis.verdict,
        "effects": list(analysis.effects),
        "steps": [step] if analysis.found else [],
        "ranking": _ranking(analysis),
        "error_before": before,
        "error_after": after,
        "floor_ratio": after,
        "next_grasp": {"grasp": grasps[0], "tells_apart": list(analysis.effects)} if grasps else None,
        "where": _where(analysis) if analysis.verdict is Verdict.UNKNOWN else None,
    } | ({"sessions": _sessions_json(analysis)} if analysis.table.sessions else {})


def _sessions_json(analysis: TableAnalysis) -> dict[str, Any]:
    repeats = analysis.repeats
    shifts = {
        s.session: {"shift_n": number(s.value), "low": number(s.low), "high": number(s.high), "squeezes": s.squeezes}
        for s in repeats.shifts
    }
    return {"p": number(repeats.p), "taken_out": repeats.shifted, "shifts": shifts, "untold": list(repeats.untold)}


def next_grasps(analysis: TableAnalysis) -> tuple[str, ...]:
    """Grasps of the menu to record next; none if nothing is open."""
    return grasps_for(analysis.found) if analysis.verdict in (Verdict.ONE_OF, Verdict.UNKNOWN) else ()


def _errors(analysis: TableAnalysis, candidate: Candidate | None, kind: str) -> dict[str, Any]:
    if candidate is None:
        return {"rms_n": None, "ratio": None, "objects": {}}
    objects = {
        name: {
            "rows": len(fit.residual),
            "rms_n": number(rms(getattr(fit, kind))),
            "ratio": number(rms(getattr(fit, kind)) / analysis.noise_n),
            "bias_n": number(np.mean(getattr(fit, kind))),
            "slope_n_m": number(fit.slope),
        }
        for name, fit in candidate.fits.items()
    }
    error = rms(getattr(candidate, kind))
    return {"rms_n": number(error), "ratio": number(error / analysis.noise_n), "objects": objects}


def _ratio(analysis: TableAnalysis, candidate: Candidate | None) -> float | None:
    return None if candidate is None else number(rms(candidate.left_out) / analysis.noise_n)


def _ranking(analysis: TableAnalysis) -> list[dict]:
    ranking, seen = [], set()
    for candidate in analysis.candidates:
        for effect, cause in CAUSES[candidate.shape.name].items():
            if effect in seen:  # under the shape that serves it best
                continue
            seen.add(effect)
            ranking.append(
                {
                    "effect": effect,
                    "p_family": number(candidate.p_family),
                    "heldout_gain": number(candidate.heldout_gain),
                    "floor_ratio_after": _ratio(analysis, candidate),
                    "parameters": {k: number(v) for k, v in cause.parameters(_onset(analysis, candidate)).items()},
                }
            )
    return ranking


def _onset(analysis: TableAnalysis, candidate: Candidate) -> Onset:
    """The shape's own parameter, mean over the objects: as a travel, on the reading, and at the motor."""
    slopes = np.array([fit.slope for fit in candidate.fits.values()])
    values = np.array([fit.values[1] for fit in candidate.fits.values()])
    is_force = candidate.shape.name == "bias"
    travel = float(np.mean(-values / slopes if is_force else values))
    reading = float(np.mean(-values if is_force else slopes * values))
    gain = analysis.position_gain
    return Onset(travel, reading, None if gain is None else gain * travel)


def _where(analysis: TableAnalysis) -> dict[str, Any] | None:
    if analysis.best is None:
        return None
    name, fit = max(analysis.best.fits.items(), key=lambda item: np.max(np.abs(item[1].residual)))
    row = int(np.argmax(np.abs(fit.residual)))
    return {
        "phase": "hold",
        "signal": "final_force",
        "object": name,
        "delta_q_m": number(analysis.rows[name].delta_m[row]),
        "residual_n": number(fit.residual[row]),
    }


def lines(analysis: TableAnalysis) -> list[str]:
    """A short table: per object the base law and the best shape, then the verdict and what to record next."""
    text = [f"{name}: left out, {why}" for name, why in analysis.skipped.items()]
    if analysis.base is None:
        return [*text, f"verdict: {analysis.verdict}: {analysis.reason}"]
    header = ("object", "rows", "base N/m", "rms N", "best shape", "", "rms N", "f_α")
    rows = [header, *(_row(analysis, name) for name in analysis.rows)]
    widths = [max(len(row[k]) for row in rows) for k in range(len(header))]
    text += ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]
    text.append(f"noise {analysis.noise_n:.3f} N ({analysis.noise_from})")
    text += facts(analysis)
    text.append(f"verdict: {analysis.verdict}: {analysis.reason}")
    if analysis.effects:
        text.append(f"effects: {', '.join(analysis.effects)}")
    text += [f"record next: {grasp}: {MENU[grasp]}" for grasp in next_grasps(analysis)]
    return text


def _laws(analysis: TableAnalysis) -> tuple[Candidate, Candidate]:
    """The base law and the best shape, of a table that could be fitted."""
    if analysis.base is None or analysis.best is None:
        raise ValueError("no object could be fitted")
    return analysis.base, analysis.best


def _row(analysis: TableAnalysis, name: str) -> tuple[str, ...]:
    law, best = _laws(analysis)
    base, fit = law.fits[name], best.fits[name]
    scale = analysis.force_scale(name)
    return (
        name,
        str(len(base.residual)),
        f"{base.slope:.0f}",
        f"{rms(base.residual):.3f}",
        best.shape.name.replace("_", " "),
        "; ".join(_with_intervals(analysis, name)),
        f"{rms(fit.residual):.3f}",
        "–" if scale is None else f"{scale[0]:.2f} [{scale[1]:.2f}, {scale[2]:.2f}]",
    )


def _with_intervals(analysis: TableAnalysis, name: str) -> list[str]:
    best, texts = _laws(analysis)[1], []
    intervals = analysis.intervals[name][best.shape.name]
    found = zip(best.shape.parameters, best.fits[name].values, intervals, strict=True)
    for parameter, value, (low, high) in found:
        words, unit = {"slope_n_m": ("slope", "N/m"), "bias_n": ("bias", "N")}.get(parameter, (parameter, ""))
        if parameter.endswith("_m") and parameter != "slope_n_m":
            words, unit, value, low, high = parameter[:-2], "mm", 1e3 * value, 1e3 * low, 1e3 * high
        digits = ".0f" if parameter == "slope_n_m" else ".2f"
        texts.append(f"{words} {value:{digits}} [{low:{digits}}, {high:{digits}}] {unit}".rstrip())
    return texts


def facts(analysis: TableAnalysis) -> list[str]:
    """What the table tells beyond its fits, one sentence each."""
    text = _of_sessions(analysis)
    if analysis.slope_ratio is not None and analysis.slopes_differ_p is not None:
        value, low, high = analysis.slope_ratio
        sure = analysis.slopes_differ_p < 0.05
        judged = "no one slope fits all objects" if sure else "one slope for all objects can't be ruled out"
        text.append(
            f"slopes differ by a factor of {value:.2f} [{low:.2f}, {high:.2f}]: {judged}"
            f" (p = {analysis.slopes_differ_p:.2g})"
        )
    kappas = {name: analysis.kappa(name) for name in analysis.rows}
    if analysis.training is not None:
        hard, soft = analysis.training.softness["force_scale"]
        scales = [scale[0] for name in analysis.rows if (scale := analysis.force_scale(name))]
        named = ", ".join(f"{name} {kappa:.3f}" for name, kappa in kappas.items())
        inside = all(soft <= scale <= hard for scale in scales)
        text.append(
            f"κ of the paper's coupling under the base law: {named}; f_α {min(scales):.2f} to {max(scales):.2f} lies"
            f" {'within' if inside else 'not within'} the range [{soft:g}, {hard:g}] that the paper randomises, and"
            f" covers {max(0.0, min(max(scales), hard) - max(min(scales), soft)) / (hard - soft):.0%} of it"
        )
    if analysis.shared:
        travel, force = analysis.shared["travel"], analysis.shared["force"]
        better = "one travel" if travel < force else "one force"
        judged = (
            "too little to tell" if abs(travel - force) < 0.1 * min(travel, force) else f"which speaks for {better}"
        )
        text.append(
            f"one onset for all objects: as a travel rms {travel:.4f} N, as a force on the reading {force:.4f} N,"
            f" {judged}; an object of a very different slope would"
        )
    return text


def _of_sessions(analysis: TableAnalysis) -> list[str]:
    """Whether sessions read alike, a sentence for each that could differ from the first."""
    repeats, text = analysis.repeats, []
    for shift in repeats.shifts:
        text.append(
            f"session {shift.session} reads {shift.value:+.3f} N [{shift.low:+.3f}, {shift.high:+.3f}] beside the first"
            f" at the same object and delta ({counted(shift.squeezes, 'squeeze')} in common)"
        )
    if repeats.p is not None:
        judged = "taken out before shapes are fitted" if repeats.shifted else "within chance: nothing is taken out"
        text.append(f"shift between sessions (p = {repeats.p:.2g}): {judged}")
    if repeats.untold:
        text.append(f"{', '.join(repeats.untold)}: too few squeezes in common to tell whether this session reads alike")
    return text


def sections(analysis: TableAnalysis) -> list[Section]:
    """What the answer rests on: the curves, the shapes that were tried, and what a table can't tell."""
    if analysis.base is None:
        return [Section("Final forces", [Text(analysis.reason, strong=True)])]
    fitted = Table(
        ("object", "rows", "base slope N/m", "rms N", "best shape", "its parameters [95 %]", "rms N", "f_α [95 %]"),
        [_row(analysis, name) for name in analysis.rows],
    )
    tried = [analysis.base, *analysis.candidates]
    shapes = Table(
        ("shape", "formula", "rms N", "rms of rows left out N", "gain ± standard error", "p, family-wise"),
        [_shape_row(c, c is analysis.base) for c in tried],
        frozenset(k for k, c in enumerate(tried) if c.shape.name in analysis.found),
    )
    count = ", ".join(f"{name} {len(rows.force_n)}" for name, rows in analysis.rows.items())
    body = [
        Text(f"{analysis.verdict}: {analysis.reason}.", strong=True),
        Picture(
            draw(analysis), "Measured final forces with the base law (dashed) and the best shape; below, residuals."
        ),
        fitted,
        *(Text(f"{sentence}.") for sentence in facts(analysis)),
        *(Text(f"{name} was left out: {why}.") for name, why in analysis.skipped.items()),
    ]
    doubt = Text(
        f"Rows per object: {count}. Noise {analysis.noise_n:.3f} N, {analysis.noise_from}. Intervals are percentiles of"
        " 999 resampled sets of residuals; with so few rows they are rough. Gains are of the log-likelihood of rows"
        " left out; p is the share of tables after the base law on which any shape does as well."
    )
    result = [Section("Final forces", body), Section("Shapes that were tried", [shapes, doubt])]
    return [*result, _limits(analysis)]


def _shape_row(candidate: Candidate, is_base: bool) -> tuple[str, ...]:
    return (
        candidate.shape.name.replace("_", " "),
        candidate.shape.formula,
        f"{rms(candidate.residual):.4f}",
        f"{rms(candidate.left_out):.4f}",
        "–" if is_base else f"{candidate.heldout_gain:+.1f} ± {candidate.lead_error:.1f}",
        "–" if is_base else f"{candidate.p_family:.3f}",
    )


def _limits(analysis: TableAnalysis) -> Section:
    rows = []
    for shape in analysis.found:
        for effect, cause in CAUSES[shape].items():
            rows.append((effect, shape.replace("_", " "), cause.how))
    blocks: list = [Text(f"Final forces have no trace of {NO_TRACE}.")]
    if rows:
        blocks = [Text("Each of these makes such a curve:"), Table(("effect", "shape", "how"), rows), *blocks]
    ahead = next_grasps(analysis)
    menu = Table(("grasp", "what it would tell"), [(k, v) for k, v in MENU.items()],
                 frozenset(k for k, name in enumerate(MENU) if name in ahead))  # fmt: skip
    return Section("What this table can't tell, and what to record next", [*blocks, menu])


def draw(analysis: TableAnalysis) -> Figure:
    """Measured points, base law and best shape of each object, and residuals of both below."""
    law, best = _laws(analysis)
    figure = Figure(figsize=(8, 5.2), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(2.2, 1))
    for k, (name, rows) in enumerate(analysis.rows.items()):
        colour, base, fit = _COLOURS[k % len(_COLOURS)], law.fits[name], best.fits[name]
        x = np.linspace(0.0, rows.delta_m.max(), 301)
        label = plain(name, len(name))
        sessions = np.array(rows.sessions or ("",) * len(rows.force_n))
        for number_of, session in enumerate(dict.fromkeys(analysis.table.sessions or ("",))):
            own, mark = sessions == session, _MARKS[number_of % len(_MARKS)]
            if own.any():
                named = f"{label} {plain(session, len(session))}".rstrip()
                above.plot(1e3 * rows.delta_m[own], rows.force_n[own], mark, color=colour, label=named)
        above.plot(1e3 * x, base.predict(x), "--", color=colour, lw=1)
        order = np.argsort(rows.delta_m, kind="stable")
        below.plot(1e3 * rows.delta_m[order], base.residual[order], "x--", color=colour, lw=0.7, ms=5)
        if analysis.found:
            above.plot(1e3 * x, fit.predict(x), color=colour, lw=1.6)
            below.plot(1e3 * rows.delta_m[order], fit.residual[order], "o-", color=colour, lw=0.9, ms=4)
    below.axhspan(-analysis.noise_n, analysis.noise_n, color="0.92", zorder=0)
    below.axhline(0, color="0.5", lw=0.6)
    above.plot([], [], "--", color="0.4", label="base law")
    if analysis.found:
        above.plot([], [], "-", color="0.4", label=best.shape.name.replace("_", " "))
    above.set_ylabel("final force, shifts taken out [N]" if analysis.repeats.shifted else "final force [N]")
    below.set_ylabel("residual [N]")
    below.set_xlabel("commanded Δq [mm]")
    above.legend(frameon=False)
    for axes in (above, below):
        axes.spines[["top", "right"]].set_visible(False)
    return figure


def number(value: float | None) -> float | None:
    """A plain finite float, or None."""
    return None if value is None or not math.isfinite(value) else float(value)
