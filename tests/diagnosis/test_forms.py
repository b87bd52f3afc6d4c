"""What effects leave may be that they act in another form; then another effect must explain all of it."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from forcegrasp.diagnosis.result import Step
from forcegrasp.diagnosis.search import forms, search
from forcegrasp.diagnosis.search.conclusion import Begun
from forcegrasp.diagnosis.search.forms import done_by_each, may_be_forms
from forcegrasp.diagnosis.search.left_over import is_worth_looking
from forcegrasp.diagnosis.search.refine import fit_with
from forcegrasp.diagnosis.study import Study
from forcegrasp.effects.for_gripper import effect_of
from forcegrasp.effects.setting import EffectSetting
from forcegrasp.identify.cross_validation import make_folds
from forcegrasp.identify.fit import fit_exactly
from forcegrasp.identify.fit_set import fit_model
from forcegrasp.identify.noise_floor import beyond_fit, excess, numerical_error, numerical_floor
from forcegrasp.identify.predict import Case, predict
from forcegrasp.identify.progress import silent
from forcegrasp.reports.diagnosis_words import left_sentence
from tests.light_set import light_gripper, light_set

#: Ten per cent more friction left than right, which dry friction of both alike can't have.
HIDDEN = "friction_asymmetry force_n=0.06 share=0.1"
BESIDES = "force_bias left_n=0.06 right_n=-0.05"
#: A gain of each sensor of its own, which does a tenth of what friction does.
SMALL = ("coulomb_friction force_n=0.06", "force_gain_asymmetry share=0.04")
FRICTION, BIAS, LAG, GAIN = (
    effect_of(name, light_gripper()) for name in ("coulomb_friction", "force_bias", "force_lag", "force_gain_asymmetry")
)


def study_of(*hidden: str):
    """A set with these effects hidden, its base model, and that with dry friction, fitted to the end."""
    target, simulators, base = fit_model(light_set(*hidden, grasps=9), 0, silent)
    numerical = beyond_fit(base.fit, numerical_error(base.fit, target))
    study = Study(target, simulators, make_folds(target.grasps), numerical)
    rough = fit_with([EffectSetting(FRICTION, "", np.array([0.06]))], base.fit.vector, study, base.fit)
    return study, base, fit_exactly(target, rough.problem, simulators, rough.vector)


@pytest.fixture(scope="module")
def other_form():
    return study_of(HIDDEN)


def test_what_a_form_is_off_by_is_more_than_noise_but_tolerated(other_form, monkeypatch):
    study, base, fit = other_form
    assert is_worth_looking(study, fit)
    assert may_be_forms(study, fit)
    assert not may_be_forms(study, base.fit)  # with no effect in the model
    monkeypatch.setattr(forms, "FORM_TOLERANCE", 0.05)
    assert not may_be_forms(study, fit)


def test_what_another_effect_does_is_not():
    study, _, fit = study_of(HIDDEN, BESIDES)
    assert not may_be_forms(study, fit)


def test_a_servo_is_asked_for_more():
    servo = SimpleNamespace(target=SimpleNamespace(gripper=SimpleNamespace(is_servo=True)))
    assert not may_be_forms(servo, SimpleNamespace(problem=SimpleNamespace(effects=(FRICTION,))))


def test_what_a_given_model_leaves_is_looked_at(other_form):
    study, base, fit = other_form
    begun = Begun(base, fit, (), (), (), 2.0, 1.1, ())
    assert begun.may_be_forms(study, fit)
    given = dataclasses.replace(begun, base=SimpleNamespace(fit=fit))
    assert not given.may_be_forms(study, fit)
    assert not dataclasses.replace(begun, floor=0.9).may_be_forms(study, fit)  # too much is left


def test_what_an_effect_does_is_what_leaving_it_out_undoes(other_form):
    study, base, fit = other_form
    (friction,) = done_by_each(study, fit)
    assert friction.shape == study.target.signals.shape
    case = fit.problem.case(fit.vector)
    own, without = predict(study.simulators.cheap, [case, Case(case.base, ())])
    expected = study.target.change(own, without)
    np.testing.assert_array_equal(friction, expected)
    assert not len(done_by_each(study, base.fit))


def test_a_search_asks_for_no_other_effect_where_none_explains_half_of_it_and_says_so(other_form, monkeypatch):
    study, base, _ = other_form
    asked, look_further = [], search.look_further

    def looked(study, fit, screen, effects, *args, **kwargs):
        asked.append([effect.name for effect in effects])
        return look_further(study, fit, screen, effects, *args, **kwargs)

    monkeypatch.setattr(search, "look_further", looked)
    found = searched(study, base, FRICTION, BIAS, LAG)
    assert found.preferred == ("coulomb_friction",)
    assert found.left
    assert found.may_be_forms
    assert asked == [["coulomb_friction", "force_bias", "force_lag"], []]
    assert "may be that it acts in another form" in left_sentence(found)
    assert "another form" not in left_sentence(dataclasses.replace(found, may_be_forms=False))


def searched(study, base, *effects):
    return search.diagnose(study.target, base, study.simulators, list(effects), np.random.default_rng(0))


@pytest.fixture(scope="module")
def small():
    return study_of(*SMALL)


@pytest.mark.long
def test_another_effect_that_explains_all_of_it_is_found(small):
    study, base, fit = small
    assert may_be_forms(study, fit)
    found = searched(study, base, FRICTION, GAIN, LAG)
    assert found.preferred == ("coulomb_friction", "force_gain_asymmetry")
    assert not found.left


@pytest.mark.parametrize(
    ("share", "left", "replaces", "is_found"),
    [(0.4, "in all", "", False), (0.6, "in all", "", True), (0.4, "", "", True), (0.4, "in all", "stiction", True)],
)
def test_one_that_leaves_something_must_explain_half_of_it(monkeypatch, share, left, replaces, is_found):
    best = cast(Any, SimpleNamespace(fit=None, share=share, replaces=replaces))
    step = Step(("force_lag",), (best,), (), 1.5, 1.2)
    monkeypatch.setattr(search, "left_over", lambda study, fit: (left, None))
    found = search._of_another(step, cast(Any, None))
    assert found == (step if is_found else Step((), (best,), (), 1.5, 1.5))


def test_nor_is_one_of_the_same_family(small, monkeypatch):
    """Of a sensor that lags in its own way two members of that family were named, each a part of it."""
    study, base, _ = small
    monkeypatch.setattr(GAIN, "family", FRICTION.family)
    assert searched(study, base, FRICTION, GAIN, LAG).preferred == ("coulomb_friction",)


def test_the_floor_is_higher_by_what_is_tolerated(other_form):
    study, _, fit = other_form
    held, tolerated = study.heldout(fit), np.full(study.target.signals.shape, 2.0)
    floor = numerical_floor(study.numerical, study.target)
    assert numerical_floor(study.numerical, study.target, tolerated=tolerated) == pytest.approx(np.hypot(floor, 2.0))
    assert excess(held, study.numerical, study.target)
    assert not excess(held, study.numerical, study.target, tolerated)
