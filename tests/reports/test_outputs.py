"""Tables, JSON and reports say what was put into the results, and no name does any harm."""

from __future__ import annotations

import base64
import dataclasses
import hashlib
import json
import re
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from forcegrasp.cli.measuring import write_results
from forcegrasp.cli.results import write_json
from forcegrasp.diagnosis.result import Step
from forcegrasp.effects import get_effect
from forcegrasp.identify.base_fit import BaseFit
from forcegrasp.identify.fit import Fit
from forcegrasp.identify.fitted_model import model_of
from forcegrasp.replay.next_grasp import NextGrasp
from forcegrasp.reports import comparison as comparison_report
from forcegrasp.reports import diagnosis as diagnosis_report
from forcegrasp.reports import diagnosis_answer, diagnosis_as_json, figures
from forcegrasp.reports import fit as fit_report
from forcegrasp.reports.html import Picture, Table
from tests.made_up import result_of

VERDICTS = ("effect", "one_of", "explained", "unknown", "not_fitted")


def shown(renderable, width: int = 80) -> str:
    console = Console(width=width, record=True, file=open("/dev/null", "w"))  # noqa: SIM115
    with console.file:
        console.print(renderable)
    return console.export_text()


def plain(content: dict, folder: Path) -> dict:
    """What a reader of the JSON file gets."""
    write_json(folder / "x.json", content)
    return json.loads((folder / "x.json").read_text())


# --- compare -------------------------------------------------------------------------------------------------------


def test_compare_json_holds_the_planted_errors(made_up, tmp_path):
    found = plain(comparison_report.compare_json(made_up.comparison, "my_set", "m.yaml", []), tmp_path)
    assert {"set", "model", "signals", "phases", "floor_ratio", "heldout"} <= set(found)
    assert (found["set"], found["model"]) == ("my_set", "m.yaml")
    hold = found["phases"]["hold"]["force_l"]
    # 5² in seven grasps, 9² in one, and the noise
    assert hold["ratio"] == pytest.approx(np.sqrt(1 + (7 * 25 + 81) / 8), rel=0.03)
    assert hold["rms_n"] == pytest.approx(hold["ratio"] * 0.013)
    assert hold["bias_n"] == pytest.approx(5.5 * 0.013, rel=0.05)
    assert found["phases"]["hold"]["position_r"]["ratio"] == pytest.approx(1, abs=0.1)
    assert found["phases"]["free"]["position_r"]["rms_m"] == pytest.approx(2.7e-5, rel=0.1)
    assert set(found["signals"]) == {"position_l", "position_r", "force_l", "force_r"}
    assert found["signals"]["force_r"]["noise_n"] == 0.013
    for signal, ratio in (("position_l", 1.1), ("force_r", 1.1)):
        assert found["heldout"][signal]["ratio"] == pytest.approx(ratio, abs=0.06)
    assert found["floor_ratio"] == pytest.approx(1.1 * np.sqrt(np.mean(made_up.comparison.residual**2)))
    assert max(found["grasps"], key=found["grasps"].get) == "g3"


def test_compare_answers_where(made_up):
    answer = comparison_report.answer(made_up.comparison)
    assert "on held-out grasps" in answer
    assert "hold, force left" in answer
    table = shown(comparison_report.printed(made_up.comparison))
    assert max(map(len, table.splitlines())) <= 80
    cell = next(c for c in made_up.comparison.cells() if (c.signal, c.phase) == ("force_l", "hold"))
    assert re.search(rf"^ +hold .* {cell.rms * 1e3:.1f} mN {cell.ratio:.1f}× ", table, re.MULTILINE)
    assert "g3 on thing 1" in comparison_report.details(made_up.comparison)[0].partition(",")[0]


def test_compare_of_a_model_that_has_not_seen_the_set(made_up):
    unseen = dataclasses.replace(made_up.comparison, heldout=made_up.comparison.residual)
    assert "to which the model was not fitted" in comparison_report.answer(unseen)


def test_compare_without_failure_says_so(made_up):
    calm = np.random.default_rng(3).standard_normal(made_up.comparison.residual.shape)
    comparison = dataclasses.replace(made_up.comparison, residual=calm, heldout=calm.copy())
    assert "no failure" in comparison_report.answer(comparison)
    assert not any("goes with" in line for line in comparison_report.details(comparison))


def test_compare_says_of_an_error_a_little_beyond_the_noise_that_it_is_too_close_to_tell(made_up):
    calm = 1.03 * np.random.default_rng(3).standard_normal(made_up.comparison.residual.shape)
    comparison = dataclasses.replace(made_up.comparison, residual=calm, heldout=calm.copy(), floor=1.0)
    told = comparison_report.answer(comparison)
    assert "up to 1.00 is noise, and up to 1.05 is too close to tell from it. These measurements show no" in told


def test_compare_can_not_tell_where_numerical_error_is_large(made_up):
    one_and_a_half = 1.5 * np.random.default_rng(3).standard_normal(made_up.comparison.residual.shape)
    comparison = dataclasses.replace(made_up.comparison, residual=one_and_a_half, heldout=one_and_a_half, floor=2.5)
    answer = comparison_report.answer(dataclasses.replace(comparison, numerical=(1.0, 1.5)))
    assert "can't tell" in answer
    assert "no failure" not in answer
    assert 'try <option timestep="0.00025"/>' in answer  # an eighth of TIAGo's, with which 0.125 would be left
    assert "multiccd" in comparison_report.answer(dataclasses.replace(comparison, numerical=(0.1, 2.0)))
    unsure = comparison_report.answer(dataclasses.replace(comparison, numerical=(0.1, 0.1)))
    assert "may be what is unsure of where windows start: this can't tell" in unsure
    assert "timestep" not in unsure
    fine = dataclasses.replace(comparison, residual=one_and_a_half / 1.5, heldout=one_and_a_half / 1.5, floor=1.5)
    assert "up to 1.50 is noise. These" in comparison_report.answer(dataclasses.replace(fine, numerical=(0.1, 0.1)))
    fine = dataclasses.replace(fine, numerical=(0.5, 0.5))
    assert "up to 1.50 is noise and the simulation's own error" in comparison_report.answer(fine)


def test_compare_says_where_one_grasp_makes_all_of_the_error(made_up):
    calm = np.random.default_rng(3).standard_normal(made_up.comparison.residual.shape)
    calm[2] *= 3
    comparison = dataclasses.replace(made_up.comparison, residual=calm, heldout=calm.copy())
    label = made_up.target.grasps[2].label
    assert f"Without grasp {label} it would be 1.0" in comparison_report.answer(comparison)
    comparison.heldout[1] *= 3
    assert "Without" not in comparison_report.answer(comparison)


def test_an_estimated_noise_is_called_a_lower_bound(made_up):
    assert "as given" in comparison_report.noise_sentence(made_up.target)
    estimated = dataclasses.replace(made_up.target, sigma_known=False)
    assert "lower bound" in comparison_report.noise_sentence(estimated)


@pytest.mark.parametrize(
    ("value", "unit", "text"), [(2.7e-5, "m", "27 µm"), (0.0123, "m", "12300 µm"), (0.0131, "N", "13.1 mN")]
)
def test_amounts_have_units(value, unit, text):
    assert comparison_report.amount(value, unit) == text


# --- fit and add ---------------------------------------------------------------------------------------------------


def test_fit_json_and_answer(made_up, tmp_path):
    found = plain(fit_report.fit_json(made_up.base, made_up.target, made_up.model, "s", Path("m.yaml")), tmp_path)
    assert found["converged"] is True
    assert found["starts"] == [2.0, 2.001, 2.3]
    assert set(found["parameters"]["position_gain"]) == {"value", "low", "high", "unit"}
    assert "rho_m of thing 0" in found["parameters"]
    assert "is fitted" in fit_report.fit_answer(made_up.base, made_up.target)
    table = shown(fit_report.printed_parameters(made_up.model))
    assert all(name in table for name in ("position_gain", "rho_m of thing 1", "N/m"))


def test_a_fit_that_did_not_converge_says_why_and_what_to_do(made_up):
    answer = fit_report.fit_answer(BaseFit(made_up.base.fit, (1.0,), False, "the starts differ"), made_up.target)
    assert "NOT fitted: the starts differ" in answer
    assert "record more grasps" in answer


def test_add_tells_the_fall(made_up, tmp_path):
    effect = get_effect("force_bias")
    found = plain(fit_report.add_json(made_up.added, effect, "s", Path("b.yaml")), tmp_path)
    assert found["error_before"] > 1.5 > 1.0 == found["error_after"]
    assert found["signals"]["force_l"]["before"] > 3 * found["signals"]["force_l"]["after"]
    assert "force_bias.left_n" in found["parameters"]
    assert "to 1.00 × noise" in fit_report.add_answer(made_up.added, effect)
    assert re.search(r"force left +\d\.\d\d +1\.\d\d", shown(fit_report.printed_fall(made_up.added, effect)))


def test_the_symptom_is_shown_where_it_is_strongest(made_up):
    picture = fit_report.symptom_picture(
        made_up.target, made_up.added.before, made_up.added.after, get_effect("force_bias")
    )
    assert "force left of grasp g3 on thing 1" in picture.caption
    labels = [text.get_text() for text in picture.figure.axes[0].get_legend().get_texts()]
    assert labels == ["measured", "without force_bias", "with force_bias"]


def at_bounds(fit: Fit) -> Fit:
    """The same fit, ended at each parameter's upper bound."""
    return dataclasses.replace(fit, vector=fit.problem.high)


def texts(sections) -> list[str]:
    """All cells of all tables of a report."""
    return [cell for s in sections for b in s.blocks if isinstance(b, Table) for row in b.rows for cell in row]


def test_a_parameter_at_its_bound_is_marked_in_every_table(made_up):
    fit = at_bounds(made_up.added.after)
    model = model_of(fit, made_up.target, made_up.loaded, [])
    assert "position_gain ended at its bound 300 N/m: doubt the model, or widen it" in model.warnings
    added = dataclasses.replace(made_up.added, after=fit, model=model)
    base = BaseFit(fit, (1.0,), True)
    for shown_texts in (
        [shown(fit_report.printed_parameters(model))],
        texts(fit_report.fit_sections(base, made_up.target, model)),
        texts(fit_report.add_sections(added, get_effect("force_bias"))),
    ):
        assert any("300 (at its bound)" in text for text in shown_texts)
        assert any("1 (at its bound)" in text for text in shown_texts)  # force_bias
    plainly = shown(fit_report.printed_parameters(made_up.model))
    assert "at its bound" not in plainly


def test_a_diagnosis_marks_parameters_at_their_bounds(made_up, tmp_path):
    one = made_up.diagnosis("one_of")
    (step,) = one.steps
    fits = [at_bounds(c.fit) for c in step.candidates]
    candidates = tuple(
        dataclasses.replace(c, fit=fit, setting=fit.problem.case(fit.vector).effects[-1])
        for c, fit in zip(step.candidates, fits, strict=True)
    )
    diagnosis = dataclasses.replace(
        one, fit=candidates[0].fit, steps=(dataclasses.replace(step, candidates=candidates),)
    )
    bias, drift = (effect.parameters[0].high for effect in (get_effect("force_bias"), get_effect("force_drift")))
    table = shown(diagnosis_report.printed(diagnosis), 200)
    cells = texts(diagnosis_report.sections(diagnosis, None, made_up.tried))
    for high in (bias, drift):
        assert f"{high:g} (at its bound) N" in table
        assert any(f"{high:g} (at its bound) N" in cell for cell in cells)
    assert f"{bias:g} (at its bound)" in cells  # the table of the effect's parameters
    lines = diagnosis_report.lines(diagnosis, None)
    assert any(line.startswith(f"  left_n {bias:g} (at its bound) N (95 %: ") for line in lines)
    warning = f"force_bias.left_n ended at its bound {bias:g} N: doubt the model, or widen it"
    assert f"warning: {warning}" in lines
    assert warning in plain(diagnosis_as_json.diagnosis_json(diagnosis, None, made_up.tried, "s"), tmp_path)["warnings"]


def test_values_of_a_step_give_way_to_final_ones(made_up):
    """The second step moved what the first had found; what was not taken keeps its step's value."""
    one = made_up.diagnosis("one_of")
    bias = one.steps[0].candidates[0]
    final = dataclasses.replace(bias.fit, vector=np.r_[bias.fit.vector[:-2], 0.0123 / 0.06, 0.0456 / 0.04])
    diagnosis = dataclasses.replace(one, fit=final)
    drift = one.steps[0].candidates[1].setting.parameters
    (left, right) = final.values[-2:]
    assert left != pytest.approx(bias.setting.parameters["left_n"])
    found = diagnosis_as_json.diagnosis_json(diagnosis, None, made_up.tried, "s")
    for rows in (found["ranking"], found["steps"][0]["ranking"]):
        assert rows[0]["parameters"] == {"left_n": left, "right_n": right}
        assert rows[1]["parameters"] == drift
    table = shown(diagnosis_report.printed(diagnosis), 200)
    assert f"left_n {left:.3g} N" in table
    cells = texts(diagnosis_report.sections(diagnosis, None, made_up.tried))
    assert any(f"left_n {left:.3g} N" in cell for cell in cells)
    step_value = f"left_n {bias.setting.parameters['left_n']:.3g} N,"
    assert not any(step_value in text for text in (table, *cells))


# --- diagnose ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("verdict", VERDICTS)
def test_diagnosis_json(made_up, verdict, tmp_path):
    diagnosis = made_up.diagnosis(verdict)
    advice = made_up.advice if verdict == "one_of" else None
    found = plain(diagnosis_as_json.diagnosis_json(diagnosis, advice, made_up.tried, "s"), tmp_path)
    assert found["verdict"] == verdict
    assert found["effects"] == {"effect": ["force_bias"], "one_of": ["force_bias", "force_drift"]}.get(verdict, [])
    assert [step["verdict"] for step in found["steps"]] == (
        [] if verdict == "not_fitted" else [verdict if found["effects"] else "none"]
    )
    assert found["floor_ratio"] == found["error_after"]
    assert found["error_before"] > 1.5
    ranked = [row["effect"] for row in found["ranking"]]
    assert ranked == ([] if verdict == "not_fitted" else ["force_bias", "force_drift", "backlash", "force_lag"])
    for row in found["ranking"]:
        refitted = row["effect"].startswith("force_") and row["effect"] != "force_lag"
        assert {"effect", "p_family", "heldout_gain", "floor_ratio_after", "parameters"} <= set(row)
        assert (row["heldout_gain"] is not None) == refitted
    assert found["no_trace"] == ([] if verdict == "not_fitted" else ["adhesion"])
    if advice:
        assert found["next_grasp"]["tells_apart"] == ["force_bias", "force_drift"]
        assert (found["next_grasp"]["grasp"], found["next_grasp"]["differences"]["slow ramp"]) == ("slow ramp", 3.0)
        assert found["next_grasp"]["bits"] == 0.9
        assert {key: found["next_grasp"][key] for key in NextGrasp.model_fields} == advice.next_grasp.model_dump()
    else:
        assert found["next_grasp"] is None
    place = found["where"]
    if found["effects"]:
        assert found["parameters"]["force_bias"]["left_n"]["unit"] == "N"
        assert place["explainable"] < 0.05
    else:
        assert (place["phase"], place["signal"]) == ("hold", "force_l")
        assert place["explainable"] == pytest.approx(1 - 1 / np.nanmean(diagnosis.heldout() ** 2))
        assert set(place["explained_by"]) >= {"command_m", "direction"}


@pytest.mark.parametrize(
    ("verdict", "told"),
    [
        ("effect", "lacks force_bias."),
        ("one_of", "force_bias or force_drift"),
        ("explained", "explains these data"),
        ("unknown", "none of the effects I know"),
        ("not_fitted", "the starts differ"),
    ],
)
def test_the_verdict_in_words(made_up, verdict, told):
    diagnosis = made_up.diagnosis(verdict)
    assert told in diagnosis_answer.answer(diagnosis)
    lines = "\n".join(diagnosis_report.lines(diagnosis, made_up.advice))
    symptom = (
        "force_bias: without it the model misses force left by 76.4 mN (5.9 × noise) in hold, most of all in grasp g3"
    )
    assert (symptom in lines) == (verdict in ("effect", "one_of"))
    assert ("could also be: force_drift" in lines) == (verdict == "one_of")
    assert "record next: slow ramp" in lines
    assert ("largest in force left, hold" in lines) == (verdict == "unknown")
    table = diagnosis_report.printed(diagnosis)
    assert (table is None) == (verdict == "not_fitted")
    assert table is None or "force_drift" in shown(table)


def test_rounding_is_found_without_any_fit(made_up, tmp_path):
    """The step has no candidates: nothing was fitted for it."""
    target = dataclasses.replace(made_up.target, quantum=np.array([0, 0, 0.04, 0.04]))
    plainly = made_up.diagnosis("effect")
    step = Step(("quantisation",), (), (), 2.0, 1.5)
    diagnosis = dataclasses.replace(
        plainly, target=target, steps=(step, *plainly.steps), effects=("quantisation", "force_bias")
    )
    found = plain(diagnosis_as_json.diagnosis_json(diagnosis, None, made_up.tried, "s"), tmp_path)
    assert [row["effect"] for row in found["ranking"]][:2] == ["quantisation", "force_bias"]
    assert found["ranking"][0]["parameters"] == {"position_step_m": 0, "force_step_n": 0.04}
    assert found["parameters"]["quantisation"]["force_step_n"]["value"] == 0.04
    assert "quantisation and force_bias" in diagnosis_answer.answer(diagnosis)
    lines = diagnosis_report.lines(diagnosis, None)
    assert "quantisation: readings of forces are multiples of 40 mN" in lines
    assert "steps: forces 40 mN" in lines[-1]
    assert "quantisation" in shown(diagnosis_report.printed(diagnosis))
    first, second = diagnosis_report.sections(diagnosis, None, made_up.tried)[1:3]
    assert (first.title, second.title) == ("1. quantisation", "2. force_bias")
    assert "multiples of 40 mN" in next(b for b in first.blocks if isinstance(b, Picture)).caption


def test_the_report_of_a_diagnosis_shows_what_the_answer_rests_on(made_up):
    sections = diagnosis_report.sections(made_up.diagnosis("one_of"), made_up.advice, made_up.tried)
    view, first, advice = sections[:3]
    assert (view.title, view.needs_script) == ("Look at the grasps", True)
    assert first.title == "1. force_bias or force_drift"
    assert "helps most" in next(b for b in first.blocks if isinstance(b, Picture)).caption
    assert advice.title == "What to record next"
    assert any(isinstance(b, Picture) for b in advice.blocks)


# --- reports -------------------------------------------------------------------------------------------------------


def all_reports(made_up):
    effect = get_effect("force_bias")
    yield comparison_report.sections(made_up.comparison, [f"note {made_up.loaded.measured.name}"])
    yield fit_report.fit_sections(made_up.base, made_up.target, made_up.model)
    yield fit_report.add_sections(made_up.added, effect)
    for verdict in VERDICTS:
        yield diagnosis_report.sections(made_up.diagnosis(verdict), made_up.advice, made_up.tried)


@pytest.mark.long
def test_reports_are_harmless_and_load_nothing(made_up, tmp_path, capsys):
    name = made_up.loaded.measured.name
    for number, sections in enumerate(all_reports(made_up)):
        out = tmp_path / str(number)
        write_results(out, result_of(name, name, sections, made_up.loaded, {"set": name}))
        html = (out / "report.html").read_text()
        # the view's data and its script, which is the only one that a browser runs, by its hash
        assert re.findall(r"<script[^>]*>", html) == ['<script type="application/json">', "<script>"]
        script = html.split("<script>")[1].split("</script>")[0]
        digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
        assert f"default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'sha256-{digest}'" in html
        assert "&lt;script&gt;" in html
        loaded = re.findall(r"(?:href|src|url)\s*[=(]\s*[\"']?([^\"')>\s]+)", html)
        assert all(link.startswith(("#", "data:")) for link in loaded)
        assert html.count("<svg") == html.count("<figure") >= 1
        assert json.loads((out / "x.json").read_text())["set"] == name
    assert str(out / "report.html") in capsys.readouterr().out


def test_of_many_grasps_the_worst_are_drawn():
    grid = np.ones((300, 5))
    grid[[7, 200]] = 9.0
    figure = figures.heat_map(grid, [f"g{i}" for i in range(300)], list("abcde"))
    labels = [label.get_text() for label in figure.axes[0].get_yticklabels()]
    assert len(labels) <= 40
    assert {"g7", "g200"} <= set(labels)


def test_signals_may_stand_still(made_up):
    """Residuals without any spread, and covariates that are nowhere defined."""
    count = made_up.target.mask.shape
    values = {"time_since_contact_s": np.full((*count, 2), np.nan), "direction": np.zeros((*count, 2))}
    figure = figures.dependence(values, np.zeros((*count, 4)), made_up.target)
    figure.canvas.draw()
