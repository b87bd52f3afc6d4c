"""The box of a report: what, how much of it, how sure, the runner-up, what is left, and the next command."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import yaml

from forcegrasp.diagnosis.faults.fault import Fault
from forcegrasp.diagnosis.faults.odd_grasps import OddGrasp
from forcegrasp.diagnosis.faults.tolerance import Moved
from forcegrasp.diagnosis.result import Diagnosis
from forcegrasp.effects import get_effect
from forcegrasp.effects.setting import EffectSetting
from forcegrasp.identify.fitted_model import model_of
from forcegrasp.identify.givens import errors_by_givens
from forcegrasp.identify.verdict import Verdict
from forcegrasp.models.model_file import write_model
from forcegrasp.reports import comparison as comparison_report
from forcegrasp.reports import diagnosis as diagnosis_report
from forcegrasp.reports import diagnosis_answer, diagnosis_as_json, figures
from forcegrasp.reports.diagnosis_box import answer_box, weakest_step
from forcegrasp.reports.diagnosis_words import percent, place_of_rest, shares_sentence
from forcegrasp.reports.html import Answer
from forcegrasp.reports.next_step import after_comparison, after_diagnosis
from forcegrasp.reports.symptom import symptom_of


def two_effects(made_up, **changed) -> Diagnosis:
    """Two steps; the second leaves 2 % of the mean square beyond the noise."""
    one = made_up.diagnosis("effect")
    (first,) = one.steps
    other = dataclasses.replace(first.candidates[1], p_family=0.008)
    steps = (
        dataclasses.replace(first, error_before=5.0, error_after=2.2),
        dataclasses.replace(first, effects=("force_drift",), candidates=(other,), error_before=2.2, error_after=1.22),
    )
    return dataclasses.replace(
        one, effects=("force_bias", "force_drift"), steps=steps, error_before=5.0, error_after=1.22, **changed
    )


def box(diagnosis: Diagnosis, advice=None) -> Answer:
    commands = after_diagnosis(diagnosis, advice, "my set", "out/base_model.yaml", "out/model.yaml")
    return answer_box(diagnosis, advice, commands, "Only some were tried.")


def test_the_headline_says_how_much_each_effect_explains(made_up):
    diagnosis = two_effects(made_up, left="in all")
    told = shares_sentence(diagnosis)
    assert told.startswith(
        "Of the error beyond the noise (mean square) force_bias explains 84%, force_drift 14%; 2% is left, "
    )
    assert told in diagnosis_answer.answer(diagnosis)
    found = diagnosis_as_json.diagnosis_json(diagnosis, None, made_up.tried, "s")
    assert found["answer"] == diagnosis_answer.answer(diagnosis)
    assert found["left_share"] + sum(found["shares"].values()) == pytest.approx(1)
    assert [name for name, _ in box(diagnosis).shares] == ["force_bias 84%", "force_drift 14%", "left 2%"]


@pytest.mark.parametrize(("error", "count", "doubtful"), [(2.4, 5, True), (1.4, 5, False), (2.4, 4, False)])
def test_many_effects_that_leave_much_may_be_others(made_up, error, count, doubtful):
    """Of a dozen effects at once, lags and delays were named in place of each other, with 2.4 × the noise left."""
    diagnosis = two_effects(made_up, left="in all")
    last = dataclasses.replace(diagnosis.steps[-1], error_after=error)
    steps = (*diagnosis.steps[:1] * (count - 1), last)
    told = diagnosis_answer.answer(dataclasses.replace(diagnosis, steps=steps, error_after=error))
    assert ("some of them may stand for others" in told) == doubtful


def with_a_small_second(made_up, left: str, error: float) -> Diagnosis:
    """Two steps, of which the first leaves so much error."""
    diagnosis = two_effects(made_up, left=left)
    first, second = diagnosis.steps
    steps = (dataclasses.replace(first, error_after=error), dataclasses.replace(second, error_before=error))
    return dataclasses.replace(diagnosis, steps=steps)


@pytest.mark.parametrize(
    ("left", "error", "doubted"), [("in all", 1.34, True), ("in all", 1.8, False), ("", 1.34, False)]
)
def test_what_explains_little_beside_another_may_be_its_form(made_up, left, error, doubted):
    """Behind presliding friction of another form came a limit of force that was not there: 3 % of the error."""
    diagnosis = with_a_small_second(made_up, left, error)
    told, sure = diagnosis_answer.answer(diagnosis), dict(box(diagnosis).rows)["How sure"]
    assert ("But force_drift may not be there: beside force_bias it explains little" in told) == doubted
    assert ("force_drift lowers the error on grasps held out of the fit, but may not be there" in sure) == doubted
    found = diagnosis_as_json.diagnosis_json(diagnosis, None, made_up.tried, "s")
    assert found["doubted"] == ["force_drift"] * doubted


def test_of_a_servos_motions_small_effects_are_not_doubted(made_up, monkeypatch):
    diagnosis = with_a_small_second(made_up, "in all", 1.34)
    monkeypatch.setattr("forcegrasp.physics.gripper.Gripper.is_servo", True)
    assert diagnosis.doubted == ()


@pytest.mark.parametrize("sought", [False, True])
def test_a_law_that_was_sought_is_not_proposed_again(made_up, sought):
    diagnosis = dataclasses.replace(made_up.diagnosis("unknown"), left="in all", law_sought=sought)
    commands = after_diagnosis(diagnosis, None, "my set", "base_model.yaml", "model.yaml")
    assert any("law=true" in command.line for command in commands) != sought
    told = [line for line in diagnosis_report.lines(diagnosis, None) if line.startswith("a law was looked for")]
    assert len(told) == sought


@pytest.mark.parametrize(
    ("verdict", "model", "place"),
    [("unknown", "base.yaml", 0), ("effect", "model.yaml", 0), ("one_of", "model.yaml", -1)],
)
def test_a_law_that_was_found_is_to_be_added(made_up, verdict, model, place):
    diagnosis = dataclasses.replace(made_up.diagnosis(verdict), left="in all", law=object(), law_sought=True)
    command = after_diagnosis(diagnosis, None, "my set", "base.yaml", "model.yaml", "out/law.yaml")[place]
    assert command.purpose == "add the law that was found"
    assert f"model={model} effect=out/law.yaml" in command.line


def test_what_is_no_more_than_noise_is_not_given_a_place(made_up):
    effect = made_up.diagnosis("effect")
    assert shares_sentence(effect).endswith("; no more than noise is left.")
    assert box(effect).shares[-1][0].startswith("noise ")
    assert shares_sentence(made_up.diagnosis("explained")) == ""


def test_the_rest_is_in_the_phase_that_has_most_of_it(made_up):
    assert place_of_rest(made_up.diagnosis("unknown")) == "in hold"


@pytest.mark.parametrize(
    ("share", "told"), [(0.0, "0%"), (0.001, "under 1%"), (0.83, "83%"), (0.997, "over 99%"), (1.0, "100%")]
)
def test_nearly_nothing_is_not_nothing(share, told):
    assert percent(share) == told


def test_an_answer_is_as_sure_as_its_weakest_step(made_up):
    diagnosis = two_effects(made_up)
    assert weakest_step(diagnosis) is diagnosis.steps[1]
    rows = dict(box(diagnosis).rows)
    assert rows["How sure"].startswith(
        "force_drift, the weakest, is clear on grasps held out of the fit: no other effect"
    )
    assert "probability of 0.008 at most" in rows["How sure"]
    assert "not all" not in rows["How sure"]
    assert dict(box(two_effects(made_up, left="in all", floor=0.5)).rows)["How sure"].endswith("But not all is found.")
    tie = dict(box(made_up.diagnosis("one_of"), made_up.advice).rows)
    assert tie["How sure"] == "Something is missing, but force_bias and force_drift explain these data alike."
    assert tie["Runner-up"] == "force_drift leaves 1.28 × noise, force_bias 1.00."


def test_what_another_step_has_found_is_no_runner_up(made_up):
    one = made_up.diagnosis("effect")
    (first,), drift = one.steps, one.steps[0].candidates[1]
    other = dataclasses.replace(first, effects=("force_drift",), candidates=(drift,))
    two = dataclasses.replace(one, effects=("force_bias", "force_drift"), steps=(first, other))
    rows = dict(box(two).rows)
    assert rows["Runner-up"].startswith("None: no other effect")


def test_what_may_be_there_besides_is_said_and_can_be_tried(made_up):
    much = dataclasses.replace(made_up.diagnosis("effect"), left="in all", floor=0.5)
    last = dataclasses.replace(much.steps[0], effects=())
    more = dataclasses.replace(
        last.candidates[0], setting=EffectSetting.typical(get_effect("backlash")), share=0.12, error_after=0.9
    )
    for share, said in ((0.12, True), (0.05, False)):
        steps = (*much.steps, dataclasses.replace(last, candidates=(dataclasses.replace(more, share=share),)))
        answer = box(dataclasses.replace(much, steps=steps))
        tried = [c.line for c in answer.commands if "effect=backlash" in c.line]
        assert tried == ["forcegrasp add 'data=my set' model=out/model.yaml effect=backlash out=better.yaml"] * said
        assert dict(answer.rows).get("Perhaps", "").startswith("backlash may be there besides: it takes") == said


def test_where_the_set_was_moved_nothing_is_said_of_what_was_not_judged_again(made_up):
    found = made_up.diagnosis("effect")
    (step,) = found.steps
    alone = dataclasses.replace(found, steps=(dataclasses.replace(step, candidates=step.candidates[:1]),))
    assert dict(box(alone).rows)["Runner-up"].startswith("None: no other effect")
    assert "Runner-up" not in dict(box(dataclasses.replace(alone, error_moved=1.4)).rows)


def test_an_effect_that_contains_what_was_found_is_no_runner_up(made_up):
    one = made_up.diagnosis("effect")
    best, other = one.steps[0].candidates
    found = [
        dataclasses.replace(c, setting=EffectSetting.typical(get_effect(name)), gains=np.full(8, gain))
        for c, name, gain in ((best, "coulomb_friction", 90.0), (best, "stiction", 91.0), (other, "backlash", 20.0))
    ]
    steps = (dataclasses.replace(one.steps[0], effects=("coulomb_friction",), candidates=tuple(found)),)
    rows = dict(box(dataclasses.replace(one, effects=("coulomb_friction",), steps=steps)).rows)
    assert "no effect but those that contain it does as well" in rows["How sure"]
    assert rows["Runner-up"].startswith("backlash, which leaves 1.28 × noise where coulomb_friction leaves 1.00")
    assert rows["Runner-up"].endswith("stiction would add little to coulomb_friction, contained in it.")


@pytest.mark.parametrize(
    ("verdict", "next_one", "purpose"),
    [
        ("effect", "forcegrasp train model=out/model.yaml", "the model that has force_bias"),
        (
            "one_of",
            "forcegrasp diagnose 'data=[my set,next]'",
            "record slow ramp (on thing 0); there force_bias and force_drift",
        ),
        ("explained", "forcegrasp train model=out/base_model.yaml", "the model"),
        ("unknown", "forcegrasp compare 'data=my set' model=out/base_model.yaml", "where the model fails"),
        ("not_fitted", "forcegrasp compare 'data=my set'", "grasps that went wrong"),
    ],
)
def test_each_verdict_has_a_next_command(made_up, verdict, next_one, purpose):
    answer = box(made_up.diagnosis(verdict), made_up.advice if verdict == "one_of" else None)
    first, *others = answer.commands
    assert first.line == next_one
    assert purpose in first.purpose
    names = verdict in ("effect", "one_of")
    assert [c.line.split()[1] for c in others] == ["add"] * names + ["diagnose"] * (verdict == "unknown")
    assert bool(answer.shares) == names
    told = dict(answer.rows)
    assert {"How sure", "Note"} <= set(told)
    assert ("Runner-up" in told, "Explains" in told) == (names, names)
    assert ("What is left" in told) == (names or verdict == "unknown")


def test_what_leaves_much_is_looked_at_before_it_is_used(made_up):
    first = box(two_effects(made_up, left="in all", floor=0.5)).commands[0]
    assert first.line == "forcegrasp compare 'data=my set' model=out/model.yaml"
    labels = dataclasses.replace(made_up.diagnosis("effect"), verdict=Verdict.DATA)
    assert box(labels).commands[0].purpose == "put the set right, and diagnose again"


def test_of_rivals_of_which_one_is_a_fault_of_the_set_that_is_checked_first(made_up):
    tie = made_up.diagnosis("one_of")
    pair = zip(tie.steps[0].candidates, ("object_size", "backlash"), strict=True)
    found = tuple(dataclasses.replace(c, setting=EffectSetting.typical(get_effect(name))) for c, name in pair)
    step = dataclasses.replace(tie.steps[0], effects=("object_size", "backlash"), candidates=found)
    (only,) = box(dataclasses.replace(tie, effects=step.effects, steps=(step,))).commands
    assert only.purpose.startswith("check object_size in the set (a calliper")
    assert only.purpose.endswith(
        f"record what tells them apart (backlash: {get_effect('backlash').separates}), and diagnose again"
    )


def test_labels_that_are_wrong_are_put_right_before_anything_is_fitted(made_up):
    odd = (OddGrasp("g3", "thing 1", 9.0, "thing 0", 1.1),)
    labels = dataclasses.replace(
        made_up.diagnosis("unknown"), verdict=Verdict.DATA, steps=(), effects=("object_labels",), odd=odd
    )
    answer = box(labels)
    assert "grasp g3 of thing 1 (9.0 × noise; 1.1 as one of thing 0)" in answer.what
    told = dict(answer.rows)
    assert told["How sure"] == "Judged by a fit of all other grasps."
    assert not {"Explains", "Error", "Runner-up", "What is left"} & set(told)
    assert [c.purpose for c in answer.commands] == ["put the set right, and diagnose again"]
    assert [line.partition(":")[0] for line in diagnosis_report.lines(labels, None)] == ["sensor noise"]


def test_a_set_that_was_put_right_is_judged_by_what_that_leaves(made_up):
    found = made_up.diagnosis("explained")
    fault = Fault("late_side", "one is late", "the rows", found.fit)
    told = dict(
        box(
            dataclasses.replace(
                found, verdict=Verdict.DATA, effects=(fault.name,), fault=fault, error_before=6.0, error_after=1.2
            )
        ).rows
    )
    assert told["How sure"].startswith("Judged on grasps held out of the fit: with the set put right 20% of the error")


@pytest.mark.parametrize("verdict", ["effect", "unknown"])
def test_what_a_set_says_wrongly_is_put_right_before_a_model_is_looked_at(made_up, verdict):
    found = made_up.diagnosis(verdict)
    fault = Fault("late_side", "one is late", "the rows", found.fit)
    purposes = [one.purpose for one in box(dataclasses.replace(found, fault=fault)).commands]
    assert purposes == ["put the set right first, and diagnose again", *(one.purpose for one in box(found).commands)]
    moved = dataclasses.replace(found, fault=dataclasses.replace(fault, moved=Moved((), np.array([]))))
    assert "put the set right" not in after_diagnosis(moved, None, "s", "b.yaml", "m.yaml")[0].purpose


def test_a_comparison_says_where_and_what_to_do(made_up):
    commands = after_comparison(made_up.comparison, "s", "m.yaml")
    answer = comparison_report.answer_box(made_up.comparison, ["a note"], commands)
    assert answer.what == comparison_report.answer(made_up.comparison)
    assert [c.line for c in answer.commands] == ["forcegrasp diagnose data=s model=m.yaml"]
    told = dict(answer.rows)
    assert told["Worst grasps"].startswith("g3 on thing 1")
    assert told["To bear in mind"] == "a note."
    calm = np.random.default_rng(3).standard_normal(made_up.comparison.residual.shape)
    fine = dataclasses.replace(made_up.comparison, residual=calm, heldout=calm)
    assert [c.line for c in after_comparison(fine, "s", "m.yaml")] == ["forcegrasp train model=m.yaml"]


def test_a_symptom_is_of_these_data(made_up):
    target, before, after = made_up.target, made_up.added.before, made_up.added.after
    symptom = symptom_of(target, before, after)
    assert (symptom.before.signal, symptom.before.phase, symptom.part) == ("force_l", "hold", "grasp g3 on thing 1")
    assert symptom.before.ratio > 5 > 1.2 > symptom.after.ratio
    assert symptom.sentence().endswith("There it is measured 73.2 mN above the model on average")
    # an error of another sign while opening than while closing
    flipped = np.array([np.gradient(g.position_m[:, 0], g.time_s) for g in target.grasps])
    residual = after.residual.copy()
    residual[..., 0] -= 8 * np.sign(np.round(flipped, 3))
    told = symptom_of(target, dataclasses.replace(before, residual=residual), after).sentence()
    assert "flips with the direction: position left is measured" in told
    assert "above the model while it closes" in told
    assert "below while it opens" in told


def test_a_value_has_one_interval_wherever_it_stands(made_up, tmp_path):
    diagnosis = made_up.diagnosis("effect")
    by_givens = tuple(errors_by_givens(diagnosis.fit, diagnosis.target, made_up.loaded.measured))
    diagnosis = dataclasses.replace(diagnosis, by_givens=by_givens)  # as a diagnosis of the whole set has them
    write_model(model_of(diagnosis.fit, diagnosis.target, made_up.loaded, diagnosis.numerical), tmp_path / "m.yaml")
    written = yaml.safe_load((tmp_path / "m.yaml").read_text())["effects"]["force_bias"]["left_n"]
    found = diagnosis_as_json.diagnosis_json(diagnosis, None, made_up.tried, "s")["parameters"]["force_bias"]["left_n"]
    assert found == pytest.approx(written)
    line = next(text for text in diagnosis_report.lines(diagnosis, None) if text.startswith("  left_n"))
    interval = f"{written['low']:.4g} to {written['high']:.4g}"
    assert line == f"  left_n {written['value']:.4g} N (95 %: {interval})"
    table = next(b for b in diagnosis_report.sections(diagnosis, None, made_up.tried)[1].blocks if hasattr(b, "header"))
    assert list(table.rows[0]) == ["left_n", f"{written['value']:.4g}", interval, "N"]


def test_a_symptom_is_where_there_are_samples_though_the_error_rises_everywhere(made_up):
    target, before, after = made_up.target, made_up.added.before, made_up.added.after
    phase = target.phase.copy()
    phase[phase == phase.max()] = phase.min()
    symptom = symptom_of(dataclasses.replace(target, phase=phase), after, before)
    assert symptom.after.samples == symptom.before.samples > 0


def test_shares_and_what_is_left_are_one_though_recordings_are_weighed_anew(made_up):
    """The second step starts from more than the first one left."""
    two = two_effects(made_up)
    first, second = two.steps
    second = dataclasses.replace(second, error_before=3.0, error_after=2.0)
    jumped = dataclasses.replace(two, steps=(first, second), error_after=2.0)
    shares = jumped.shares()
    assert sum(shares.values()) == pytest.approx(1 - (2.0**2 - 1) / (5.0**2 - 1))
    assert shares["force_bias"] / shares["force_drift"] == pytest.approx((5.0**2 - 2.2**2) / (3.0**2 - 2.0**2))
    assert two.shares()["force_bias"] == pytest.approx((5.0**2 - 2.2**2) / (5.0**2 - 1))  # without a jump as it fell


@pytest.mark.parametrize(("gain", "rows"), [(5.0, 2), (-5.0, 1)])
def test_what_was_tried_last_and_made_grasps_worse_is_not_in_the_table(made_up, gain, rows):
    found = made_up.diagnosis("effect")
    (step,), best = found.steps, found.steps[0].candidates[0]
    first = dataclasses.replace(step, candidates=(best,))
    last = dataclasses.replace(step, effects=(), candidates=(dataclasses.replace(best, gains=np.full(4, gain)),))
    table = diagnosis_report.printed(dataclasses.replace(found, steps=(first, last)))
    assert table.row_count == rows


def test_single_readings_that_went_wrong_are_told_by_their_place(made_up):
    comparison = made_up.comparison
    residual = np.clip(comparison.residual, -4.0, 4.0)  # of what lasts, readings beside are off as well
    assert comparison_report.details(dataclasses.replace(comparison, residual=residual))[0].startswith("worst grasps")
    residual[1, 40:42, 0] = 148.0, -9.6  # the one after it is of the tails of the noise
    residual[0, 60, 2] = 25.0
    residual[2, 60:62, 2] = 30.0  # two in a row are a knock
    (told, *_) = comparison_report.details(dataclasses.replace(comparison, residual=residual))[1:]
    assert told.startswith("readings that went wrong: position left at 1.6 s of g1")
    assert "by 4e+03 µm" in told or "by 3996 µm" in told
    assert ", force left at 2.4 s of" in told  # after the one that is further off
    assert told.endswith("while those beside fit; look at these rows")
    assert "g2" not in told
    found = made_up.diagnosis("unknown")
    left = found.fit.residual.clip(-4.0, 4.0)
    assert "went wrong:" not in " ".join(diagnosis_report.lines(with_residual(found, left), None))
    left[1, 40:42, 0] = 148.0, -9.6
    left[0, 60, 2] = 25.0
    assert told in diagnosis_report.lines(with_residual(found, left), None)


@pytest.mark.parametrize(("times", "is_told"), [(1.05, False), (1.3, True)])
def test_where_held_out_grasps_are_missed_by_more_it_is_said_what_errors_by_phase_are_of(made_up, times, is_told):
    comparison = made_up.comparison
    further = dataclasses.replace(comparison, heldout=times * comparison.residual)
    fitted = dataclasses.replace(comparison, heldout=comparison.residual).floor_ratio()
    told = [line for line in comparison_report.details(further) if line.startswith("errors by phase: ")]
    assert told == [f"errors by phase: of the fit to all grasps, {fitted:.2f} × noise in all"] * is_told


@pytest.mark.parametrize(("times", "is_told"), [(1.8, False), (2.2, True)])
def test_a_grasp_that_shows_what_no_other_does_is_told(made_up, times, is_told):
    residual = np.where(made_up.target.mask[..., None], 2.0, 0.0) * np.ones(made_up.comparison.residual.shape)
    heldout = 1.3 * residual
    heldout[1] = times * residual[1]
    comparison = dataclasses.replace(made_up.comparison, residual=residual, heldout=heldout)
    told = [line for line in comparison_report.details(comparison) if line.startswith("held out: ")]
    label = made_up.target.grasps[1].label
    line = f"held out: {label} is missed by {2 * times:.1f} × noise, 2.0 × in the fit to all: no other grasp shows what"
    assert told == [f"{line} it does; record more like it"] * is_told


def with_residual(diagnosis: Diagnosis, residual: np.ndarray) -> Diagnosis:
    """The same with a final fit that leaves something else."""
    return dataclasses.replace(diagnosis, fit=dataclasses.replace(diagnosis.fit, residual=residual))


def test_axes_of_hinges_are_in_angles_and_keep_their_names(made_up, monkeypatch):
    monkeypatch.setitem(figures.SHOWN, "m", ("mrad", 1e3))
    comparison = made_up.comparison
    page = figures.dependence(comparison.covariates(), comparison.residual, comparison.target)
    labels = {axes.get_xlabel() for axes in page.axes}
    assert {"command [mrad]", "velocity [mrad/s]"} <= labels


@pytest.mark.parametrize(("measured", "foretold", "wrong"), [
    ([0, 0, 90, 0, 0], [0, 0, 0, 0, 0], True),
    ([0, 90, 90, 90, 90], [0, 0, 90, 90, 90], False),  # a step that comes a sample early
    ([0, 40, 90, 95, 99], [0, 35, 40, 91, 99], False),  # a ramp that is late
    ([0, 0, 90, 0, 0], [0, 0, 30, 0, 0], False),  # a blow that the model knows, too, if weaker
    ([0, 0, 0, 0, 0], [0, 0, 60, 0, 0], False),  # and one that it alone has
])  # fmt: skip
def test_what_comes_a_sample_early_or_late_is_no_wrong_reading(made_up, measured, foretold, wrong):
    """Of a gripper whose commands act late, the first reading after each step of a hard object's force was told so."""
    comparison = made_up.comparison
    predicted, residual = np.zeros((2, *comparison.predicted.shape))
    sigma = np.broadcast_to(comparison.target.sigma, predicted.shape)
    predicted[1, 40:45, 0] = foretold
    residual[1, 40:45, 0] = np.subtract(measured, foretold)
    told = dataclasses.replace(comparison, predicted=predicted * sigma, residual=residual).wrong_readings()
    assert [tuple(place) for place in told] == ([(1, 42, 0)] if wrong else [])
