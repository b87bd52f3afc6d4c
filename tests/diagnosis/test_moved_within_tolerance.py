"""What a set gives moves within its tolerance, before effects are looked for and beside them."""

from __future__ import annotations

import dataclasses
import functools
import importlib
from types import SimpleNamespace

import numpy as np
import pytest

from forcegrasp.diagnosis import set_search
from forcegrasp.diagnosis.diagnose_set import diagnose_set
from forcegrasp.diagnosis.faults.suspects import suspects
from forcegrasp.diagnosis.faults.tolerance import move_given
from forcegrasp.diagnosis.givens.moved_set import go_on_with_moved
from forcegrasp.diagnosis.search.search import diagnose
from forcegrasp.effects import get_effect
from forcegrasp.identify.fit_set import apply_model
from forcegrasp.identify.loading import Loaded
from forcegrasp.reports.diagnosis import sections
from forcegrasp.reports.diagnosis_answer import answer
from forcegrasp.reports.diagnosis_as_json import diagnosis_json
from forcegrasp.reports.diagnosis_box import answer_box
from tests.diagnosis.test_faults_of_the_set import changed, silent, with_model
from tests.diagnosis.test_faults_of_the_set import refitted as refitted  # a fixture
from tests.diagnosis.test_faults_of_the_set import sound as sound  # a fixture
from tests.light_set import light_set


def inexact(name: str, radius_m: float, offset_m: float, radius_std_m: float = 5e-5):
    """A change of the set: one object's radius, and all places."""

    def change(measured):
        grasps = tuple(
            dataclasses.replace(g, radius_m=g.radius_m + radius_m * (g.object == name), offset_m=g.offset_m + offset_m)
            for g in measured.grasps
        )
        return dataclasses.replace(measured, grasps=grasps, radius_std_m=radius_std_m)

    return change


def test_what_is_given_moves_within_its_tolerance_and_is_told(sound):
    loaded, model = sound
    name = loaded.measured.grasps[0].object
    measured = inexact(name, 1e-4, 4e-4)(loaded.measured)
    diagnosis, _ = diagnose_set(dataclasses.replace(loaded, measured=measured), model, ["force_bias"], 0, silent)
    assert (diagnosis.verdict, diagnosis.effects) == ("explained", ())
    assert diagnosis.error_before > 1.3 > diagnosis.error_after
    assert "What the set gives was moved within its tolerance: radius of thing_0 by -0." in answer(diagnosis)


def test_given_more_exactly_it_does_not_move(sound):
    loaded, model = sound
    name = loaded.measured.grasps[0].object
    measured = inexact(name, 1e-4, 0.0, radius_std_m=1e-6)(loaded.measured)
    target, _, base = apply_model(dataclasses.replace(loaded, measured=measured), model, silent, refit=True)
    assert move_given(measured, target, base.fit) is None
    easy = dataclasses.replace(measured, radius_std_m=5e-5)
    moved = move_given(easy, target, base.fit)
    assert moved is not None
    assert moved.moves[f"radius_m of {name}"] == pytest.approx(-1e-4, abs=3e-5)
    assert max(abs(moved.moves[f"offset_m of {g.name}"]) for g in measured.grasps) < 2e-4
    assert moved.price > len(moved.moves) == len({g.object for g in measured.grasps}) + len(measured.grasps)


def test_where_noise_leaves_less_than_it_should_nothing_moves(sound):
    loaded, model = sound
    target, _, base = apply_model(loaded, model, silent, refit=True)
    calm = dataclasses.replace(base.fit, residual=0.9 * base.fit.residual)
    assert calm.cost < target.readings
    assert move_given(loaded.measured, target, calm) is None
    assert move_given(loaded.measured, target, dataclasses.replace(calm, residual=0 * calm.residual)) is None


@functools.cache
def late(delay_s: float) -> Loaded:
    """The same grasps with commands that act late."""
    return light_set(f"command_delay delay_s={delay_s}")


def test_a_small_lag_is_taken_by_the_tolerance_and_told(sound):
    diagnosis, _ = diagnose_set(late(0.0037), sound[1], ["command_delay"], 0, silent)
    assert (diagnosis.verdict, diagnosis.effects) == ("explained", ())
    assert diagnosis.error_before > 1.3 > 1.1 > diagnosis.error_after
    assert "What the set gives was moved within its tolerance: time of reading by -3." in answer(diagnosis)
    fault = diagnosis_json(diagnosis, None, [], "s")["fault"]
    assert fault["name"] == "timing_tolerance"
    assert fault["moved"] == {"readout_skew_s": pytest.approx(-0.0037, abs=0.001)}
    assert "time of reading by -3." in str(answer_box(diagnosis, None, []))


@pytest.mark.long
def test_a_delay_beyond_the_tolerance_is_an_effect(sound):
    diagnosis, _ = diagnose_set(late(0.02), sound[1], ["command_delay", "actuator_lag"], 0, silent)
    assert suspects(late(0.02), diagnosis.target, diagnosis.base.fit) == []
    assert (diagnosis.verdict, diagnosis.effects, diagnosis.fault) == ("effect", ("command_delay",), None)


def test_a_delay_at_the_end_of_its_tolerance_may_be_either(sound):
    diagnosis, _ = diagnose_set(late(0.0045), sound[1], ["command_delay"], 0, silent)
    assert (diagnosis.verdict, diagnosis.effects) == ("one_of", ("command_delay", "timing_tolerance"))
    assert "Or the set is wrong, and nothing is missing: timing_tolerance (time of reading by -" in answer(diagnosis)


def test_said_to_be_exact_a_small_lag_is_an_effect(sound):
    """And with a wide tolerance a larger one is none."""
    loaded = late(0.0037)
    target, _, base = apply_model(loaded, sound[1], silent, refit=True)
    assert move_given(loaded.measured, target, base.fit) is not None
    assert move_given(dataclasses.replace(loaded.measured, delay_std_s=1e-4), target, base.fit) is None
    wide = dataclasses.replace(late(0.02), measured=dataclasses.replace(late(0.02).measured, delay_std_s=0.015))
    target, _, base = apply_model(wide, sound[1], silent, refit=True)
    moved = move_given(wide.measured, target, base.fit)
    assert moved is not None
    assert moved.is_no_surprise
    assert moved.moves["readout_skew_s"] == pytest.approx(-0.02, abs=0.002)


def test_a_clock_that_is_a_little_off_is_no_effect(sound):
    loaded, model = sound
    stretched = changed(loaded, lambda g: dataclasses.replace(g, time_s=1.03 * g.time_s))
    stretched = dataclasses.replace(stretched, measured=dataclasses.replace(stretched.measured, period_std_share=0.015))
    diagnosis, _ = diagnose_set(stretched, model, ["command_delay", "actuator_lag", "force_lag"], 0, silent)
    assert (diagnosis.verdict, diagnosis.effects) == ("explained", ())
    assert "What the set gives was moved within its tolerance: the clock's period by -2.9 %" in answer(diagnosis)


def test_a_clock_that_is_further_off_moves_within_a_wider_tolerance(sound):
    loaded, model = sound
    stretched = changed(loaded, lambda g: dataclasses.replace(g, time_s=1.06 * g.time_s))
    target, _, base = apply_model(stretched, model, silent, refit=True)
    exact = dataclasses.replace(stretched.measured, delay_std_s=1e-4)
    assert move_given(exact, target, base.fit) is None
    moved = move_given(dataclasses.replace(exact, period_std_share=0.03), target, base.fit)
    assert moved is not None
    assert moved.moves["period_share"] == pytest.approx(1 / 1.06 - 1, abs=0.01)
    assert "the clock's period by -" in moved.words()
    put = moved.put(stretched.measured.grasps[0]).time_s
    assert put[-1] == pytest.approx(loaded.measured.grasps[0].time_s[-1], rel=0.01)


@pytest.mark.parametrize(("radius_std_m", "moves"), [(2.5e-4, True), (1e-6, False)])
def test_a_search_goes_on_with_what_is_given_moved(sound, radius_std_m, moves):
    loaded, model = sound
    name = loaded.measured.grasps[0].object
    measured = inexact(name, 5e-4, 0.0, radius_std_m)(loaded.measured)
    inexactly = dataclasses.replace(loaded, measured=measured)
    target, simulators, base = apply_model(inexactly, model, silent, refit=True)

    def search(target, simulators, base, start=None):
        return diagnose(target, base, simulators, [], np.random.default_rng(0), start=start)

    found = search(target, simulators, base)
    assert found.left
    again = go_on_with_moved(found, inexactly, lambda t, s, bare, fit, steps: search(t, s, bare, (fit, steps)), silent)
    assert (again is not None) == moves
    if again is not None:
        diagnosis, _ = again
        assert (diagnosis.left, diagnosis.verdict) == ("", "explained")
        assert diagnosis.error_before == found.error_before > 1.1 * diagnosis.error_after
        assert f"radius of {name} by -0." in answer(diagnosis)


@pytest.mark.long
@pytest.mark.parametrize("names", [[], ["force_crosstalk"]])
def test_an_effect_gets_no_credit_for_what_was_moved_and_none_need_be_found(names):
    loaded, model = with_model(light_set("force_crosstalk share=0.07 difference=0"))
    name = loaded.measured.grasps[0].object
    inexactly = dataclasses.replace(loaded, measured=inexact(name, 6e-4, 0.0, 2.5e-4)(loaded.measured))
    target, simulators, base = apply_model(inexactly, model, silent, refit=True)
    catalogue = [get_effect(name) for name in names]

    def search(target, simulators, base, start=None):
        return diagnose(target, base, simulators, catalogue, np.random.default_rng(0), start=start)

    found = search(target, simulators, base)
    again = go_on_with_moved(found, inexactly, lambda t, s, bare, fit, steps: search(t, s, bare, (fit, steps)), silent)
    assert again is not None
    diagnosis, _ = again
    assert diagnosis.preferred == tuple(names)
    assert diagnosis.error_before > 1.1 * diagnosis.error_moved
    assert not diagnosis.base.fit.problem.effects
    assert diagnosis.base.fit.problem.grasps is diagnosis.fit.problem.grasps
    assert f"from {diagnosis.error_before:.2f} to {diagnosis.error_moved:.2f} × noise" in answer(diagnosis)
    page = sections(diagnosis, None, catalogue)
    if not names:
        assert (diagnosis.verdict, diagnosis.error_after) == ("unknown", diagnosis.error_moved)
        return
    step = diagnosis.steps[0]
    assert (step.error_before, step.error_after) == (diagnosis.error_moved, diagnosis.error_after)
    assert sum(diagnosis.shares().values()) == pytest.approx(diagnosis.explained, abs=0.02)
    assert step.candidates[0].fit.problem.grasps is diagnosis.fit.problem.grasps
    assert len(page) > 1


@pytest.mark.parametrize(
    ("left", "after", "believed"), [("", 3.0, True), ("in all", 3.0, False), ("in all", 2.0, True)]
)
def test_effects_on_trial_are_believed_where_a_move_beside_them_leaves_nothing_or_little(
    sound, made_up, monkeypatch, left, after, believed
):
    loaded, model = sound
    bolder = dataclasses.replace(made_up.diagnosis("effect"), left="in all")
    found = dataclasses.replace(made_up.diagnosis("unknown"), bolder=bolder)
    moved = dataclasses.replace(bolder, left=left, error_before=4.0, error_after=after, floor=1.2)
    module = importlib.import_module("forcegrasp.diagnosis.diagnose_set")
    monkeypatch.setattr(set_search, "diagnose", lambda *_: found)
    monkeypatch.setattr(module, "suspects", lambda *_: [])
    monkeypatch.setattr(set_search, "go_on_with_moved", lambda one, *_: (moved, None) if one is bolder else None)
    for name in ("may_be_late_rows", "within_tolerance_after_all"):
        monkeypatch.setattr(module, name, lambda one, *_: one)
    diagnosis, _ = diagnose_set(loaded, model, [], 0, silent)
    assert diagnosis.effects == (moved if believed else found).effects


@pytest.mark.parametrize("promised_much", [False, True])
def test_what_was_sought_in_vain_is_not_sought_again_after_a_small_move(sound, made_up, monkeypatch, promised_much):
    found = dataclasses.replace(made_up.diagnosis("unknown"), left="in all")
    module = importlib.import_module("forcegrasp.diagnosis.diagnose_set")
    asked = []

    def diagnosed(*args):
        *_, stop_when = args
        asked.append(stop_when)
        if len(asked) == 1 and promised_much:
            stop_when.may_be_given(found.target, found.fit)
        return found

    def moved(one, loaded, search_on, *_):
        return search_on(one.target, None, one.base, one.fit, one.steps), None

    monkeypatch.setattr(set_search, "diagnose", diagnosed)
    monkeypatch.setattr(set_search.SetSearch, "search_as_given", lambda *_: (None, False))
    monkeypatch.setattr(module, "suspects", lambda *_: [])
    monkeypatch.setattr(set_search, "go_on_with_moved", moved)
    within = SimpleNamespace(is_within=True), 1.0
    monkeypatch.setattr("forcegrasp.diagnosis.givens.moved_set.first_move", lambda *_: within)
    monkeypatch.setattr("forcegrasp.diagnosis.givens.left_out.most_missed", lambda *_: ())
    for name in ("may_be_late_rows", "timing_within_tolerance_after_all"):
        monkeypatch.setattr(module, name, lambda one, *_: one)
    diagnose_set(sound[0], sound[1], [], 0, silent)
    _, again = asked
    assert again.may_be_given(found.target, found.fit) == (not promised_much)
