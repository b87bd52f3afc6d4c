"""A look-alike that was found first goes, once what was hidden is in the model; what is true stays."""

from __future__ import annotations

import dataclasses
import functools
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from forcegrasp.diagnosis.result import Candidate, Step, kept_steps
from forcegrasp.diagnosis.search import needless, search
from forcegrasp.diagnosis.search.needless import drop_all_needless, drop_needless, simplify
from forcegrasp.diagnosis.search.so_far import SoFar
from forcegrasp.diagnosis.study import Study
from forcegrasp.effects.for_gripper import effect_of
from forcegrasp.effects.setting import EffectSetting
from forcegrasp.identify.cross_validation import make_folds, rms
from forcegrasp.identify.fit import fit_exactly
from forcegrasp.identify.fit_set import fit_model
from forcegrasp.identify.noise_floor import beyond_fit, numerical_error
from forcegrasp.identify.problem import Problem
from forcegrasp.identify.simulators import Simulators
from tests.diagnosis.test_families import jaw_with, silent


@pytest.fixture(scope="module")
def rubbing():
    """A jaw with dry friction, and its base model."""
    loaded = jaw_with("coulomb_friction", force_n=0.08)
    return loaded, *fit_model(loaded, 0, silent)


def step_with(rubbing, *names: str):
    """A study, a step that found the last of these effects, and its fit."""
    return step_of(rubbing, [EffectSetting.typical(effect_of(name, rubbing[0].gripper)) for name in names])


def step_of(jaw, effects: list[EffectSetting]):
    """The same from given sizes."""
    loaded, target, simulators, base = jaw
    problem = Problem(loaded.gripper, target.grasps, effects)
    start = np.r_[base.fit.vector, problem.start()[len(base.fit.vector) :]]
    fit = fit_exactly(target, problem, Simulators(problem), start)
    own_errors = beyond_fit(base.fit, numerical_error(base.fit, target))
    study = Study(target, simulators, make_folds(target.grasps), own_errors)
    last, error = fit.problem.case(fit.vector).effects[-1], rms(study.heldout(fit), target)
    found = Candidate(last, fit, 0.002, np.ones(4), error, 0.9, 0.5, np.ones(1))
    return study, Step((last.effect.name,), (found,), (), 5.0, error), fit


@pytest.fixture(scope="module")
def found(rubbing):
    """:func:`step_with` of that jaw, each made once."""
    return functools.cache(functools.partial(step_with, rubbing))


def test_a_look_alike_goes_once_what_was_hidden_is_there(found):
    study, step, fit = found("motor_offset", "coulomb_friction")
    left, less = drop_needless(study, step, fit, 0)
    assert left.replaces == "motor_offset"
    assert [one.effect.name for one in less.problem.effects] == ["coulomb_friction"]
    assert left.candidates[0].fit is less
    assert left.error_after < 1.05 * step.error_after
    first = dataclasses.replace(step, effects=("motor_offset",))
    assert kept_steps([first, left]) == [left]


@pytest.mark.long
def test_what_has_become_a_simpler_effect_is_named_so(found):
    study, step, fit = found("motor_offset", "presliding")
    left, less = drop_needless(study, dataclasses.replace(step, effects=("presliding", "coulomb_friction")), fit, 0)
    assert (left.replaces, left.effects) == ("motor_offset", ("coulomb_friction",))
    assert left.candidates[0].effect.name == "coulomb_friction"
    assert [one.effect.name for one in less.problem.effects] == ["coulomb_friction"]


def test_what_is_needed_or_was_given_stays(found):
    study, step, fit = found("coulomb_friction", "motor_offset")
    assert drop_needless(study, step, fit, 0) == (step, fit)
    study, step, fit = found("motor_offset", "coulomb_friction")
    assert drop_needless(study, step, fit, 1) == (step, fit)


def test_all_that_is_no_longer_needed_goes_and_its_step_with_it(found):
    study, step, fit = found("motor_offset", "coulomb_friction")
    first = dataclasses.replace(step, effects=("motor_offset",))
    steps, less = drop_all_needless(study, [first, step], fit, 0)
    assert steps == [step]
    assert [one.effect.name for one in less.problem.effects] == ["coulomb_friction"]
    assert drop_all_needless(study, [first, step], fit, 2) == ([first, step], fit)  # they were given
    assert drop_all_needless(study, [first, step], fit, 0, {"coulomb_friction"}) == ([first, step], fit)  # not doubted


@pytest.mark.parametrize("at_once", [True, False])
def test_what_was_found_at_once_is_asked_for_again_at_the_end(found, monkeypatch, at_once):
    """Beside others that have become simpler since; what was found one by one was held against these already."""
    study, step, fit = found("motor_offset", "coulomb_friction")
    (last,) = step.candidates
    last = dataclasses.replace(last, without=fit if at_once else None)
    first = dataclasses.replace(last, setting=fit.effect("motor_offset"))
    steps = [
        dataclasses.replace(step, effects=(one.effect.name,), candidates=(one,), error_before=before, error_after=after)
        for one, before, after in ((first, 5.0, 4.0), (last, 4.0, 1.0))
    ]
    for name in ("simplify", "merge", "_look_beside_all"):
        monkeypatch.setattr(search, name, lambda study, steps, fit, *_: (steps, fit))
    so_far = SoFar((study, steps, fit))
    search._tidy_up(so_far, cast(Any, SimpleNamespace(given=0, effects=())))
    _, left, less = so_far.all
    names = ["coulomb_friction"] if at_once else ["motor_offset", "coulomb_friction"]
    assert [one.effect.name for one in less.problem.effects] == names
    assert [one.effects for one in kept_steps(left)] == [(name,) for name in names]
    assert left[0].error_before == 5.0


@pytest.mark.parametrize(
    ("beyond_chance", "left", "worse", "asked"),
    [(True, "", 1.02, False), (True, "", 1.3, True), (True, "1.1 × noise", 1.02, True), (False, "", 1.3, False)],
)
def test_what_the_search_would_not_look_for_is_not_asked_for(found, monkeypatch, beyond_chance, left, worse, asked):
    """Where noise alone is left, an effect must lower the error of some signal in some phase by a tenth."""
    study, _, fit = found("coulomb_friction")
    held = study.heldout(fit)
    monkeypatch.setattr(needless, "is_beyond_chance", lambda *_: beyond_chance)
    monkeypatch.setattr(needless, "excess", lambda *_: left)
    assert needless._is_asked_for(study, worse * held, held) == asked


def test_a_step_takes_the_place_of_one_effect_at_most(found):
    study, step, fit = found("motor_offset", "coulomb_friction")
    (last,) = step.candidates
    step = dataclasses.replace(step, candidates=(dataclasses.replace(last, replaces="stiction"),))
    assert drop_needless(study, step, fit, 0) == (step, fit)


@pytest.mark.long
def test_what_only_a_richer_effect_has_goes_where_another_found_later_makes_up_for_it(found):
    study, step, fit = found("stiction", "motor_offset")
    first = dataclasses.replace(found("stiction")[1], error_before=9.0)
    nothing = dataclasses.replace(step, effects=(), error_before=step.error_after)
    steps, less = simplify(study, [first, step, nothing], fit, 0)
    assert [one.effects for one in steps] == [("coulomb_friction",), ("motor_offset",), ()]
    assert {one.effect.name for one in less.problem.effects} == {"coulomb_friction", "motor_offset"}
    assert steps[0].candidates[0].setting.values == pytest.approx([0.08], rel=0.1)
    error = study.error(study.heldout(less))
    assert [one.error_before for one in steps] == [9.0, steps[0].error_after, error]
    assert [one.error_after for one in steps[1:]] == [error, error]
    assert simplify(study, [first, step], fit, 1) == ([first, step], fit)  # it was given
    assert simplify(study, [first], found("stiction")[2], 0)[0] == [first]  # nothing was found after it


@pytest.mark.long
def test_what_only_a_richer_effect_has_stays_where_most_of_the_rest_is_of_it():
    """Coulomb's friction explains 97 % of what friction does here, and leaves twice the noise."""
    loaded = jaw_with("stiction", breakaway_n=0.08, kinetic_share=0.9)
    stiction, offset = (EffectSetting.typical(effect_of(name, loaded.gripper)) for name in ("stiction", "motor_offset"))
    stiction.values[:2] = 0.08, 0.9
    study, step, fit = step_of((loaded, *fit_model(loaded, 0, silent)), [stiction, offset])
    first = dataclasses.replace(step, effects=("stiction",))
    assert simplify(study, [first, step], fit, 0) == ([first, step], fit)
