"""A diagnosis that is cut short tells what was found by then, and does nothing more."""

from __future__ import annotations

import dataclasses
import importlib

import numpy as np
import pytest

from forcegrasp.cli.diagnose import sigterm_as_ctrl_c
from forcegrasp.diagnosis import set_search
from forcegrasp.diagnosis.cut_short import INTERRUPTED
from forcegrasp.diagnosis.diagnose_set import diagnose_set
from forcegrasp.diagnosis.faults.fault import Fault
from forcegrasp.diagnosis.givens.doubt import with_fault_beside
from forcegrasp.diagnosis.search.search import diagnose
from forcegrasp.diagnosis.search.so_far import SoFar
from forcegrasp.diagnosis.search.step import look_further
from forcegrasp.effects.for_gripper import effect_of
from forcegrasp.identify.verdict import Verdict
from forcegrasp.replay.time_limit import OutOfTimeError, check_time, time_limit
from forcegrasp.reports.diagnosis_answer import answer
from forcegrasp.reports.diagnosis_box import answer_box
from forcegrasp.reports.next_step import after_diagnosis
from tests.diagnosis.test_exchange import rubbing as rubbing  # a fixture
from tests.diagnosis.test_families import silent
from tests.light_set import light_set

REASONS = [(KeyboardInterrupt(), INTERRUPTED), (OutOfTimeError(3), "its 3 min were over")]
SEARCH = importlib.import_module("forcegrasp.diagnosis.search.search")
OF_SET = importlib.import_module("forcegrasp.diagnosis.diagnose_set")


def raising(reason: BaseException):
    def ends(*_, **__):
        raise reason

    return ends


@pytest.mark.parametrize(("reason", "words"), REASONS)
@pytest.mark.parametrize("when", [0, 1])
def test_what_was_found_is_kept(rubbing, monkeypatch, when, reason, words):
    """Cut short in the first step, or after it, while what was found is tidied up."""
    _, target, simulators, base = rubbing
    steps = []

    def look(*arguments, **more):
        if len(steps) == when:
            raise reason
        steps.append(look_further(*arguments, **more))
        return steps[-1]

    monkeypatch.setattr(SEARCH, "look_further", look)
    monkeypatch.setattr(SEARCH, "simplify", raising(reason))
    monkeypatch.setattr("forcegrasp.diagnosis.search.conclusion.ask_again", None)  # takes simulations
    with time_limit(3):
        found = diagnose(
            target, base, simulators, [effect_of("coulomb_friction", target.gripper)], np.random.default_rng(0)
        )
        monkeypatch.setattr("time.monotonic", lambda: np.inf)
        check_time()  # what is left to do may take as long as it takes
    assert found.stopped == words
    assert found.verdict is (Verdict.EFFECT if when else Verdict.UNKNOWN)
    assert found.effects == (("coulomb_friction",) if when else ())


def test_effects_on_trial_are_not_told_when_the_trial_is_cut_short():
    assert SoFar("all", "believed").sure == "believed"
    assert SoFar("all").sure == "all"


@pytest.mark.parametrize("reason", [reason for reason, _ in REASONS])
def test_a_set_is_not_searched_on_after_that(rubbing, monkeypatch, reason):
    """No moves within tolerance, no law, no second opinion: they would take minutes."""
    loaded, target, simulators, base = rubbing
    monkeypatch.setattr(set_search.fit_set, "fit_model", lambda *_, **__: (target, simulators, base))
    monkeypatch.setattr(SEARCH, "look_further", raising(reason))
    monkeypatch.setattr(set_search, "go_on_with_moved", None)
    for name in ("find_law", "more_likely"):
        monkeypatch.setattr(OF_SET, name, None)
    found, _ = diagnose_set(loaded, None, ["coulomb_friction"], 0, silent, law=True)
    assert found.stopped
    assert not found.law_sought


@pytest.mark.parametrize(
    ("module", "where"), [(OF_SET, "suspects"), (set_search, "go_on_with_moved"), (OF_SET, "find_law")]
)
@pytest.mark.parametrize("reason", [reason for reason, _ in REASONS])
def test_it_may_be_cut_short_anywhere_once_the_base_model_is_fitted(rubbing, monkeypatch, module, where, reason):
    loaded, target, simulators, base = rubbing
    monkeypatch.setattr(set_search.fit_set, "fit_model", lambda *_, **__: (target, simulators, base))
    monkeypatch.setattr(module, where, raising(reason))
    found, _ = diagnose_set(loaded, None, ["coulomb_friction"], 0, silent, law=True)
    assert found.stopped
    assert found.effects == (() if where == "suspects" else ("coulomb_friction",))
    assert not found.law_sought


@pytest.mark.parametrize("reason", [reason for reason, _ in REASONS])
@pytest.mark.parametrize("when", [1, 2])
def test_a_fault_that_was_put_right_by_then_is_told(monkeypatch, when, reason):
    """Cut short while the set put right is doubted again, or while the set as it is, is searched to be held against."""
    loaded, asked = light_set(grasps=6), []
    grasps = tuple(dataclasses.replace(grasp, time_s=1.5 * grasp.time_s) for grasp in loaded.measured.grasps)
    loaded = dataclasses.replace(loaded, measured=dataclasses.replace(loaded.measured, grasps=grasps))
    suspects = OF_SET.suspects

    def doubted(*arguments):
        if len(asked) == when:
            raise reason
        return asked.append(arguments) or suspects(*arguments)

    monkeypatch.setattr(OF_SET, "suspects", doubted)
    # so that the set as it is must be held against it
    monkeypatch.setattr(OF_SET, "with_fault_beside", lambda *_: dataclasses.replace(with_fault_beside(*_), left="much"))
    found, _ = diagnose_set(loaded, None, ["force_bias"], 0, silent)
    assert found.stopped
    assert found.fault is not None
    assert found.fault.name == "time_scale"


@pytest.mark.parametrize(("reason", "words"), REASONS)
@pytest.mark.parametrize("where", ["with_own_slopes", "errors_by_givens"])
def test_what_a_search_found_at_its_end_stands_when_its_intervals_are_cut_short(where, reason, words, monkeypatch):
    told, loaded = [], light_set(grasps=6)
    monkeypatch.setattr(OF_SET, where, raising(reason))
    found, _ = diagnose_set(loaded, None, ["force_bias"], 0, told.append)
    assert (found.verdict, found.stopped, found.by_givens) == (Verdict.EXPLAINED, "", ())
    assert words in told[-1]


def test_nothing_is_told_before_the_base_model_is_fitted(rubbing, monkeypatch):
    monkeypatch.setattr(set_search.fit_set, "fit_model", raising(OutOfTimeError(3)))
    with pytest.raises(OutOfTimeError, match=r"give it more \(minutes=\)"):
        diagnose_set(rubbing[0], None, [], 0, silent)


@pytest.mark.parametrize(
    ("verdict", "told", "next_line"),
    [
        ("effect", "what is named here was found by then", "forcegrasp diagnose data=my_set model=found.yaml"),
        ("unknown", "nothing was found by then", "forcegrasp diagnose data=my_set"),
    ],
)
def test_the_answer_says_first_that_not_all_was_tried(made_up, verdict, told, next_line):
    found = dataclasses.replace(made_up.diagnosis(verdict), stopped="its 3 min were over")
    assert answer(found).startswith(f"The search did not end, for its 3 min were over: {told}, and not all effects")
    assert "none of the effects I know" not in answer(found)
    commands = after_diagnosis(found, None, "my_set", "known.yaml", "found.yaml")
    assert [command.line for command in commands] == [next_line]
    shown = answer_box(found, None, commands)
    assert told in " ".join([shown.what, *(text for _, text in shown.rows)])


def test_a_fault_of_the_set_that_was_found_is_not_nothing(made_up):
    fault = Fault("object_radius", "the radius of foam is 22.0 mm, the set says 23.5 mm", "", made_up.loaded)
    found = dataclasses.replace(made_up.diagnosis("unknown"), stopped=INTERRUPTED, fault=fault)
    assert answer(found).startswith("The search did not end, for it was interrupted: what is named here was found")


def test_a_schedulers_signal_ends_it_as_ctrl_c_does():
    import signal

    before = signal.getsignal(signal.SIGTERM)
    with pytest.raises(KeyboardInterrupt), sigterm_as_ctrl_c():
        signal.raise_signal(signal.SIGTERM)
    assert signal.getsignal(signal.SIGTERM) is before
