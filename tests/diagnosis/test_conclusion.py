"""What the steps of a search add up to, and where the fit of the base model is to blame."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from forcegrasp.diagnosis.result import Diagnosis, Step
from forcegrasp.diagnosis.search import at_once, conclusion, search
from forcegrasp.effects import get_effect
from forcegrasp.identify.verdict import Verdict


@pytest.fixture
def found_by(made_up, monkeypatch):
    """Runs the search with steps that are given."""

    def run(
        *steps: Step, converged: bool = True, settled: bool = False, unfinished: bool = False, forms: bool = False
    ) -> Diagnosis:
        following = iter((*steps, Step((), (), (), 1.0, 1.0)))
        base = made_up.base.fit
        monkeypatch.setattr(search, "look_further", lambda *a, **k: next(following))
        monkeypatch.setattr(search, "_fitted_anyway", lambda *a: None)
        monkeypatch.setattr(search, "better_without", lambda *a: None)
        for module in (search, conclusion):
            monkeypatch.setattr(module, "numerical_error", lambda fit, target: (0 * fit.residual + 0.1,) * 2)
        monkeypatch.setattr(search, "Screen", lambda *a: None)
        monkeypatch.setattr(search, "_may_be_another", lambda *a: False)
        monkeypatch.setattr(at_once, "add_up", lambda *a: False)
        monkeypatch.setattr(conclusion, "may_be_forms", lambda *a: forms)
        monkeypatch.setattr(search, "with_few", lambda study, fit: study)
        effects = [get_effect(name) for name in ("force_bias", "force_drift", "backlash", "stiction")]
        nothing = cast(Any, SimpleNamespace())
        assert base.problem.effects == ()
        gate = dataclasses.replace(made_up.base, converged=converged, settled=settled, unfinished=unfinished)
        return search.diagnose(made_up.target, gate, nothing, effects, np.random.default_rng(0))

    return run


def test_effects_lists_what_was_found_and_then_the_rivals(made_up, found_by):
    bias, drift = made_up.diagnosis("one_of").steps[0].candidates
    half = dataclasses.replace(bias, fit=drift.fit)  # something is left, so that the search goes on
    diagnosis = found_by(
        Step(("force_bias", "stiction", "backlash"), (half,), (), 2.0, 1.6),
        Step(("force_drift", "backlash"), (dataclasses.replace(drift, fit=bias.fit),), (), 1.6, 1.0),
    )
    assert diagnosis.verdict == "one_of"
    assert diagnosis.effects == ("force_bias", "force_drift", "stiction", "backlash")
    assert diagnosis.preferred == ("force_bias", "force_drift")
    assert diagnosis.explained > 0.95


def test_where_the_base_fit_stopped_short_what_explains_most_is_an_answer(made_up, found_by, monkeypatch):
    bias, drift = made_up.diagnosis("one_of").steps[0].candidates
    half = dataclasses.replace(bias, fit=drift.fit)
    end = dataclasses.replace(made_up.base, converged=False)
    monkeypatch.setattr(conclusion, "check_gradient", lambda *_: end)
    for candidate, most, verdict in ((bias, 0.9, "effect"), (half, 0.9, "not_fitted"), (half, 0.5, "effect")):
        monkeypatch.setattr(conclusion, "EXPLAINED_FAR", most)
        assert found_by(Step(("force_bias",), (candidate,), (), 2.0, 1.6), converged=False).verdict == verdict


@pytest.mark.parametrize(("floor", "verdict"), [(1.0, "not_fitted"), (1.5, "effect")])
def test_what_explains_most_beyond_the_floor_is_an_answer(made_up, found_by, monkeypatch, floor, verdict):
    """Noise is not all that no effect can explain."""
    bias, drift = made_up.diagnosis("one_of").steps[0].candidates
    half = dataclasses.replace(bias, fit=drift.fit)
    end = dataclasses.replace(made_up.base, converged=False)
    monkeypatch.setattr(conclusion, "check_gradient", lambda *_: end)
    monkeypatch.setattr(search, "numerical_floor", lambda *_: floor)
    assert found_by(Step(("force_bias",), (half,), (), 2.0, 1.6), converged=False).verdict == verdict


def test_where_the_base_fit_stopped_short_what_led_a_fit_to_its_end_is_an_answer(made_up, found_by, monkeypatch):
    bias, drift = made_up.diagnosis("one_of").steps[0].candidates
    half = dataclasses.replace(bias, fit=drift.fit)
    for converged, verdict in ((False, "not_fitted"), (True, "effect")):
        end = dataclasses.replace(made_up.base, converged=converged)
        monkeypatch.setattr(conclusion, "check_gradient", lambda *_, end=end: end)
        assert found_by(Step(("force_bias",), (half,), (), 2.0, 1.6), converged=False).verdict == verdict


def test_what_was_found_in_a_hurry_is_told_though_no_fit_came_to_its_end(made_up, found_by, monkeypatch):
    """What the set gives is to be moved then, or time is over."""
    bias, drift = made_up.diagnosis("one_of").steps[0].candidates
    half = dataclasses.replace(bias, fit=drift.fit)
    end = dataclasses.replace(made_up.base, converged=False)
    monkeypatch.setattr(conclusion, "check_gradient", lambda *_: end)
    found = []
    monkeypatch.setattr(at_once.AtOnce, "given_is_first", lambda *_: found.append(None) or len(found) > 1)
    diagnosis = found_by(Step(("force_bias",), (half,), (), 2.0, 1.6), converged=False)
    assert (diagnosis.verdict, diagnosis.effects) == ("effect", ("force_bias",))
    found.append(None)
    assert found_by(converged=False).verdict == "not_fitted"  # nor where nothing was found by then


def test_an_effect_that_explains_little_is_not_believed_before_a_fresh_look(made_up, found_by):
    """Beside what was found since, signatures of others may be other than they were."""
    bias, drift = made_up.diagnosis("one_of").steps[0].candidates
    half = dataclasses.replace(bias, fit=drift.fit)
    little = Step(("force_drift",), (drift,), (), 1.6, 1.5, of_many=True)
    more = Step(("backlash",), (drift,), (), 1.6, 1.0)
    diagnosis = found_by(Step(("force_bias",), (half,), (), 2.0, 1.6), little, more)
    assert diagnosis.effects == ("force_bias", "backlash")


@pytest.mark.parametrize(("left", "verdict"), [("", "explained"), ("1.3 × noise", "not_fitted")])
def test_a_base_fit_that_stopped_short_and_leaves_nothing_is_good_enough(found_by, monkeypatch, left, verdict):
    """Contacts are rough: with a wrong radius put right one start had ended at 1.00 × noise, and others elsewhere."""
    monkeypatch.setattr(conclusion, "left_by_many", lambda *_: (left, None, ""))
    monkeypatch.setattr(search, "is_worth_looking", lambda *_: False)
    assert found_by(converged=False).verdict == verdict


@pytest.mark.parametrize(("settled", "verdict"), [(True, "unknown"), (False, "not_fitted")])
def test_where_no_step_leads_further_it_is_not_the_fit_that_is_to_blame(found_by, monkeypatch, settled, verdict):
    monkeypatch.setattr(conclusion, "left_by_many", lambda *_: ("1.3 × noise", None, ""))
    monkeypatch.setattr(search, "is_worth_looking", lambda *_: False)
    assert found_by(converged=False, settled=settled).verdict == verdict


@pytest.mark.parametrize(("verdict", "told"), [("effect", True), ("unknown", False)])
def test_what_is_left_may_be_the_form_only_of_what_is_named(made_up, found_by, monkeypatch, verdict, told):
    bias, drift = made_up.diagnosis("one_of").steps[0].candidates
    half = dataclasses.replace(bias, fit=drift.fit)
    monkeypatch.setattr(conclusion, "conclude", lambda *a, **k: Verdict(verdict))
    monkeypatch.setattr(conclusion, "MUCH", np.inf)
    diagnosis = found_by(Step(("force_bias",), (half,), (), 2.0, 1.6), forms=True)
    assert diagnosis.left
    assert diagnosis.may_be_forms == told


def test_a_verdict_asks_for_the_share_of_the_largest_effect(made_up, found_by, monkeypatch):
    bias, drift = made_up.diagnosis("one_of").steps[0].candidates
    half = dataclasses.replace(bias, fit=drift.fit)
    asked = []
    monkeypatch.setattr(conclusion, "conclude", lambda *_, largest, **__: asked.append(largest) or Verdict.UNKNOWN)
    steps = Step(("force_bias",), (half,), (), 2.0, 1.8), Step(("force_drift",), (half,), (), 1.8, 1.5)
    diagnosis = found_by(*steps)
    assert asked == [pytest.approx((1.8**2 - 1.5**2) / (diagnosis.error_before**2 - 1))]


def test_intervals_are_those_of_the_final_fit(made_up, found_by):
    (bias, _) = made_up.diagnosis("effect").steps[0].candidates
    diagnosis = found_by(Step(("force_bias",), (bias,), (), 2.0, 1.0))
    assert diagnosis.fit is bias.fit
    assert [n.shape for n in diagnosis.numerical] == [bias.fit.residual.shape] * 2
    assert np.all(diagnosis.numerical[0] == 0.1 + 0 * bias.fit.residual)


@pytest.fixture
def brought_to_its_end(made_up, monkeypatch):
    """What a base fit that was left before its end comes to: so much of its residuals, converged or not."""
    asked = []

    def to(share: float, converged: bool) -> list[int]:
        def finished(base, target, simulators):
            asked.append(1)
            fit = dataclasses.replace(base.fit, residual=share * base.fit.residual)
            return dataclasses.replace(base, fit=fit, converged=converged, unfinished=False)

        monkeypatch.setattr(conclusion, "finished", finished)
        return asked

    return to


@pytest.mark.parametrize(("converged", "verdict"), [(True, "unknown"), (False, "not_fitted")])
def test_where_nothing_is_found_the_base_fit_is_brought_to_its_end(
    made_up, found_by, brought_to_its_end, converged, verdict
):
    asked = brought_to_its_end(0.9999, converged)
    diagnosis = found_by(converged=False, unfinished=True)
    assert (diagnosis.verdict, len(asked)) == (verdict, 1)
    assert diagnosis.base.fit is diagnosis.fit is made_up.base.fit  # it was there


def test_the_search_begins_again_where_a_base_fit_leads_that_was_left_before_its_end(
    made_up, found_by, brought_to_its_end
):
    asked = brought_to_its_end(0.8, True)
    diagnosis = found_by(Step((), (), (), 1.0, 1.0), converged=False, unfinished=True)
    assert (diagnosis.verdict, len(asked)) == ("unknown", 1)
    assert diagnosis.fit is diagnosis.base.fit is not made_up.base.fit


def test_what_leaves_nothing_needs_no_end_of_the_base_fit(made_up, found_by, brought_to_its_end):
    bias = made_up.diagnosis("effect").steps[0].candidates[0]
    asked = brought_to_its_end(0.8, True)
    diagnosis = found_by(Step(("force_bias",), (bias,), (), 2.0, 1.0), converged=False, unfinished=True)
    assert (diagnosis.verdict, asked) == ("effect", [])


def test_a_search_that_is_cut_short_does_not_wait_for_the_base_fit(made_up, found_by, brought_to_its_end, monkeypatch):
    def stop(*_):
        raise KeyboardInterrupt

    asked = brought_to_its_end(0.8, True)
    monkeypatch.setattr(search, "left_to_try", stop)
    diagnosis = found_by(converged=False, unfinished=True)
    assert (diagnosis.verdict, asked, bool(diagnosis.stopped)) == ("unknown", [], True)
