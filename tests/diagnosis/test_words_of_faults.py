"""What a diagnosis says of a set that may be wrong, of delays of whole rows, and of grasps that no others tell of."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from forcegrasp.diagnosis.faults.fault import Fault, besides
from forcegrasp.diagnosis.faults.tolerance import Moved
from forcegrasp.effects import get_effect
from forcegrasp.effects.setting import EffectSetting
from forcegrasp.identify.givens import Given
from forcegrasp.identify.problem import Problem
from forcegrasp.identify.verdict import Verdict
from forcegrasp.reports.diagnosis import lines
from forcegrasp.reports.diagnosis_answer import answer
from forcegrasp.reports.diagnosis_as_json import diagnosis_json
from forcegrasp.reports.diagnosis_box import answer_box
from forcegrasp.reports.diagnosis_words import fault_words, row_sentence
from forcegrasp.reports.next_step import after_diagnosis


@pytest.fixture
def fault(made_up) -> Fault:
    return Fault("time_scale", "stamps are too long", "the clock", made_up.loaded)


def test_a_fault_that_an_effect_could_be_is_told_last(made_up, fault):
    rivals = dataclasses.replace(
        made_up.diagnosis("effect"), verdict=Verdict.ONE_OF, effects=("force_bias", "time_scale"), fault=fault
    )
    text = answer(rivals)
    assert text.startswith("The model lacks force_bias")
    told = "Or the set is wrong, and nothing is missing: time_scale (stamps are too long; to check: the clock);"
    assert told in text


@pytest.mark.parametrize("advised", [True, False])
def test_where_only_the_set_is_in_doubt_it_is_checked_and_no_grasp_is_asked_for(made_up, fault, advised):
    rivals = dataclasses.replace(
        made_up.diagnosis("effect"), verdict=Verdict.ONE_OF, effects=("force_bias", "time_scale"), fault=fault
    )
    first, other = after_diagnosis(rivals, made_up.advice if advised else None, "set", "base.yaml", "found.yaml")
    assert first.purpose == "check time_scale in the set (the clock); put right what is wrong there, and diagnose again"
    assert first.line == "forcegrasp diagnose data=set"
    assert other.purpose == "until then take force_bias, which is preferred"


def test_of_several_effects_all_that_are_preferred_are_trained_with_until_then(made_up):
    found = made_up.diagnosis("effect")
    step = found.steps[0]
    other = dataclasses.replace(
        step, effects=("coulomb_friction", "backlash"), error_before=step.error_after, error_after=1.0
    )
    both = dataclasses.replace(
        found, verdict=Verdict.ONE_OF, effects=("force_bias", "coulomb_friction", "backlash"), steps=(step, other)
    )
    _, until_then = after_diagnosis(both, None, "set", "base.yaml", "found.yaml")
    assert until_then.purpose.startswith("until then train with the model that has force_bias and")
    assert "model=found.yaml" in until_then.line


def test_a_fault_besides_an_effect_is_told_first(made_up, fault):
    both = dataclasses.replace(made_up.diagnosis("effect"), effects=("time_scale", "force_bias"), fault=fault)
    assert answer(both).startswith("The set seems to be wrong: time_scale (stamps are too long; to check: the clock).")
    assert "The model lacks force_bias" in answer(both)
    assert diagnosis_json(both, None, made_up.tried, "s")["fault"] == {
        "name": "time_scale", "words": "stamps are too long", "check": "the clock", "moved": None, "then": None
    }  # fmt: skip


def test_the_box_tells_a_fault_alone_in_a_line_for_each_thing(made_up, fault):
    alone = dataclasses.replace(
        made_up.diagnosis("explained"), verdict=Verdict.DATA, effects=("time_scale",), steps=(), fault=fault
    )
    box = answer_box(alone, None, [])
    assert box.what == "Not the model but the set seems to be wrong: time_scale."
    rows = dict(box.rows)
    assert (rows["What is wrong"], rows["To check"]) == ("Stamps are too long.", "The clock.")
    assert f"{alone.error_before:.2f} → {alone.error_after:.2f}" in rows["Error"]


@pytest.mark.parametrize(
    ("error_moved", "told"),
    [(0.8, "That alone takes the error from"), (1.01, "That shows only beside what the model lacks")],
)
def test_a_move_that_lowers_no_error_alone_is_not_said_to(made_up, fault, error_moved, told):
    found = made_up.diagnosis("effect")
    moved = Moved((Given("radius_m", "cup", 1e-4, np.ones(2, bool)),), np.ones(1))
    fault = dataclasses.replace(fault, moved=moved)
    said = answer(dataclasses.replace(found, fault=fault, error_moved=error_moved * found.error_before))
    assert told in said
    assert said.startswith("The model lacks"), "nothing is wrong with the set: the verdict comes first"


@pytest.mark.parametrize(
    ("moves", "told"),
    [
        ((-1.9, 0.0, -2.0), True),
        ((-1.9,), False),
        ((1.9, 2.0), False),
        ((-1.9, 1.7, 0.1), False),
        ((-3.5, -0.3, -0.2), False),  # one alone is wrong
    ],
)
def test_radii_that_are_smaller_on_average_may_be_backlash(made_up, fault, moves, told):
    """A gap lets fingers come nearer before they press, on every object alike; other errors of radii do not."""
    found = made_up.diagnosis("effect")
    radii = tuple(Given("radius_m", f"object {i}", 3e-4, np.ones(2, bool)) for i in range(len(moves)))
    fault = dataclasses.replace(fault, moved=Moved(radii, np.array(moves)))
    said = answer(dataclasses.replace(found, fault=fault, error_moved=0.8 * found.error_before))
    assert ("smaller on average so, as backlash would have them look" in said) == told
    assert ("objects are 0.39 mm smaller" in said) == told


@pytest.mark.parametrize(("move", "told"), [(2.0, "within its tolerance"), (4.0, "by more than its tolerance")])
def test_what_was_moved_besides_is_told_with_the_fault(made_up, fault, move, told):
    found = made_up.diagnosis("effect")
    moved = Moved((Given("radius_m", "cup", 1e-4, np.ones(2, bool)),), np.array([move]))
    then = Fault("object_tolerance", "radius of cup", "the cup", made_up.loaded, moved)
    both = besides(fault, then)
    assert (both.name, both.words) == ("time_scale", f"stamps are too long; then, {told}, radius of cup")
    told_in_json = diagnosis_json(dataclasses.replace(found, fault=both), None, made_up.tried, "set")["fault"]["moved"]
    assert told_in_json == pytest.approx({"radius_m of cup": 1e-4 * move})


def test_two_faults_are_told_as_two(made_up, fault):
    put_right = dataclasses.replace(made_up.loaded)
    both = besides(fault, Fault("object_radius", "the radius of cup is 20 mm", "the cup", put_right))
    assert both.put_right is put_right
    assert both.moved_by is None
    found = dataclasses.replace(made_up.diagnosis("explained"), verdict=Verdict.DATA, effects=both.names, fault=both)
    assert found.effects == ("time_scale", "object_radius")
    first, second = "time_scale (stamps are too long;", "object_radius (the radius of cup is 20 mm; to check: the cup)"
    assert f"wrong: {first} to check: the clock) and {second}" in answer(found)
    assert f"wrong: {first} to check: the clock) and {second}" in fault_words(
        dataclasses.replace(found, verdict=Verdict.UNKNOWN)
    )
    told = diagnosis_json(found, None, made_up.tried, "s")["fault"]
    assert (told["name"], told["then"]["name"]) == found.effects
    box = answer_box(dataclasses.replace(found, steps=()), None, [])
    assert box.what == "Not the model but the set seems to be wrong: time_scale and object_radius."
    assert dict(box.rows)["What is wrong"] == "Stamps are too long. The radius of cup is 20 mm."
    assert dict(box.rows)["To check"] == "The clock. The cup."


@pytest.mark.parametrize(("delay_s", "told"), [(0.04, "1 row"), (0.0802, "2 rows"), (0.06, ""), (0.003, "")])
def test_a_delay_of_whole_rows_may_be_the_log(made_up, delay_s, told):
    found = made_up.diagnosis("effect")
    setting = EffectSetting(get_effect("command_delay"), "", np.array([delay_s]))
    problem = Problem(made_up.loaded.gripper, found.fit.problem.grasps, [setting])
    start, slopes = problem.start(), found.fit.jacobian[..., : len(problem)]
    late = dataclasses.replace(
        found, fit=dataclasses.replace(found.fit, problem=problem, vector=start, jacobian=slopes)
    )
    sentence = row_sentence(late)
    assert (f"command_delay is {told} of the set" in sentence) if told else (sentence == "")
    at_start = dataclasses.replace(late, steps=())
    assert (sentence in lines(at_start, None)) == bool(told)


def test_a_heldout_error_that_the_fit_does_not_have_gets_its_reason(made_up):
    found = made_up.diagnosis("explained")
    assert "those held out are missed" in answer(dataclasses.replace(found, error_after=2.5))
    assert "those held out are missed" not in answer(dataclasses.replace(found, error_after=1.0))
