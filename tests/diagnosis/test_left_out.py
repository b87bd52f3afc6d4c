"""One grasp that no fit can follow must not hide what all others show."""

from __future__ import annotations

import dataclasses
from collections import Counter
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from forcegrasp.diagnosis.diagnose_set import diagnose_set
from forcegrasp.diagnosis.faults.odd_grasps import OddGrasp
from forcegrasp.diagnosis.givens.left_out import is_answer, most_missed, without
from forcegrasp.identify.verdict import Verdict
from forcegrasp.reports.diagnosis_answer import answer
from forcegrasp.reports.diagnosis_as_json import diagnosis_json
from forcegrasp.reports.diagnosis_box import answer_box
from forcegrasp.reports.diagnosis_words import left_out_words
from forcegrasp.reports.results import DiagnoseResult
from tests.diagnosis.test_faults_of_the_set import silent, with_model
from tests.light_set import light_set


def missed(*errors: float, objects: str = "abc" * 4, rest: float = 3.0, servo: bool = False) -> tuple[str, ...]:
    """Of twelve grasps of these objects; the first ones are missed by so much, the others by ``rest``."""
    of_each = np.array([*errors, *[rest] * (12 - len(errors))])
    grasps = tuple(SimpleNamespace(name=str(i), object=name) for i, name in enumerate(objects))
    target = SimpleNamespace(gripper=SimpleNamespace(is_servo=servo), grasps=grasps, mask=np.ones((12, 5), bool))
    fit = SimpleNamespace(residual=of_each[:, None, None] * np.ones((12, 5, 4)))
    return most_missed(cast(Any, target), cast(Any, fit))


def test_those_that_are_missed_far_more_than_the_rest_are_the_few_to_leave_out():
    assert missed(8.0, 9.0) == ("1", "0")
    assert missed(8.0, 7.0) == ("0",)
    assert missed() == ()


def test_none_is_where_many_are_missed_or_noise_is_all_or_windows_are_of_a_servo():
    assert missed(8.0, 8.0, 8.0) == ()
    assert missed(8.0, servo=True) == ()
    assert missed(2.0, objects="a" * 12, rest=0.5) == ()


def test_an_object_keeps_two_grasps():
    assert missed(9.0, 9.0, objects="aaa" + "b" * 9, rest=1.0) == ("0",)


@pytest.mark.parametrize(
    ("verdict", "left", "after", "good"),
    [
        ("effect", "", 1.0, True),
        ("effect", "in all", 1.2, True),
        ("effect", "in all", 3.0, False),
        ("unknown", "", 1.0, False),
        ("explained", "", 1.0, False),
    ],
)
def test_only_effects_that_explain_as_good_as_all_of_the_rest_are_an_answer(made_up, verdict, left, after, good):
    found = dataclasses.replace(made_up.diagnosis(verdict), left=left, error_before=5.0, error_after=after, floor=1.0)
    assert is_answer(found) == good


@pytest.mark.parametrize(("names", "good"), [("7", True), ("78", False)])
def test_one_grasp_went_wrong_where_the_model_explains_all_others_and_several_may_show_an_effect(made_up, names, good):
    odd = tuple(OddGrasp(name, "a", 9.0) for name in names)
    found = dataclasses.replace(made_up.diagnosis("explained"), left="", error_after=1.0, floor=1.0, left_out=odd)
    assert is_answer(found) == good


@pytest.mark.parametrize(("of_model", "good"), [(2.9, False), (3.1, True)])
def test_so_are_effects_that_leave_no_more_than_their_model_can_foretell(made_up, monkeypatch, of_model, good):
    found = dataclasses.replace(made_up.diagnosis("effect"), left="in all", error_after=3.0, floor=1.0)
    monkeypatch.setattr(type(found), "floor_of_model", of_model)
    assert is_answer(found) == good


@pytest.mark.parametrize(("errors", "went_wrong"), [((9.0,), True), ((1.4,), False), ((1.4, 9.0), True)])
def test_a_grasp_that_the_final_model_foretells_did_not_go_wrong(made_up, errors, went_wrong):
    odd = tuple(OddGrasp(str(place), "a", error) for place, error in enumerate(errors))
    told = left_out_words(dataclasses.replace(made_up.diagnosis("effect"), error_after=1.0, left_out=odd))
    assert told.startswith(f"Left out: grasp 0 of a ({errors[0]} × noise under the model that was found)")
    assert ("went wrong" in told) == went_wrong
    assert ("foretells it as well as the others" in told) != went_wrong


@pytest.fixture(scope="module")
def shaken():
    """Twelve grasps whose force sensors read too little, but for one in which an object shook."""
    loaded, model = with_model(light_set("force_deadzone threshold_n=0.1", grasps=12))
    rng = np.random.default_rng(0)
    bad = loaded.measured.grasps[7]
    shaking = dataclasses.replace(bad, force_n=bad.force_n * (1 + 4 * rng.choice([-1, 1], (len(bad.time_s), 1))))
    grasps = tuple(shaking if g is bad else g for g in loaded.measured.grasps)
    return dataclasses.replace(loaded, measured=dataclasses.replace(loaded.measured, grasps=grasps)), model


@pytest.mark.long
def test_a_grasp_that_shook_is_left_out_and_told(shaken):
    loaded, model = shaken
    diagnosis, _ = diagnose_set(loaded, model, ["force_deadzone", "command_delay"], 0, silent)
    assert (diagnosis.verdict, diagnosis.effects) == (Verdict.EFFECT, ("force_deadzone",))
    assert [grasp.name for grasp in diagnosis.left_out] == ["7"]
    assert diagnosis.error_after < 1.2 < 2 < diagnosis.left_out[0].error
    assert "7" not in {grasp.name for grasp in diagnosis.target.grasps}
    told = f"Left out: grasp 7 of {diagnosis.left_out[0].object} ("
    assert told in answer(diagnosis)
    rows = dict(answer_box(diagnosis, None, ()).rows)
    assert rows["Left out"].startswith("Grasp 7 of ")
    (of_json,) = diagnosis_json(diagnosis, None, [], "s")["left_out"]
    assert of_json["name"] == "7"
    result = DiagnoseResult(loaded, diagnosis, None, (), ())
    assert result.model.warnings[0].startswith("fitted without 7, which the model misses far more")


@pytest.mark.long
def test_a_grasp_that_went_wrong_is_told_where_the_model_explains_all_others():
    """Its left finger was read 3 mm off: no effect is of one grasp."""
    loaded, model = with_model(light_set(grasps=12))
    bad = loaded.measured.grasps[7]
    off = dataclasses.replace(bad, position_m=bad.position_m + np.array([0.003, 0.0]))
    grasps = tuple(off if g is bad else g for g in loaded.measured.grasps)
    spoilt = dataclasses.replace(loaded, measured=dataclasses.replace(loaded.measured, grasps=grasps))
    diagnosis, _ = diagnose_set(spoilt, model, ["force_deadzone", "command_delay"], 0, silent)
    assert diagnosis.verdict is Verdict.EXPLAINED
    assert diagnosis.error_after < diagnosis.floor < diagnosis.left_out[0].error / 2
    assert f"Left out: grasp 7 of {bad.object} (" in answer(diagnosis)


def test_a_set_without_grasps_has_all_others(shaken):
    loaded, _ = shaken
    rest = without(loaded, ["7", "2"])
    left = [grasp.name for grasp in rest.measured.grasps]
    assert left == [g.name for g in loaded.measured.grasps if g.name not in ("7", "2")]
    assert Counter(left).most_common(1)[0][1] == 1
