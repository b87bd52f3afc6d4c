"""What could not be told apart is asked again of the whole model."""

from __future__ import annotations

import dataclasses
import functools
from types import SimpleNamespace

import numpy as np
import pytest

from forcegrasp.diagnosis.givens.moved_set import _models, _with_rivals_that_do_as_well
from forcegrasp.diagnosis.result import Step
from forcegrasp.diagnosis.search.ask_again import ask_again
from forcegrasp.effects import get_effect
from forcegrasp.effects.for_gripper import effect_of
from forcegrasp.effects.setting import EffectSetting
from forcegrasp.identify.fit_set import fit_model
from forcegrasp.identify.target import Target
from tests.diagnosis.test_families import jaw_with, silent
from tests.diagnosis.test_needless import step_with

FRICTION, DEADBAND, LAG = "coulomb_friction", "position_deadband", "actuator_lag"


@pytest.fixture(scope="module")
def found():
    """:func:`step_with` of a jaw with dry friction, each made once."""
    loaded = jaw_with(FRICTION, force_n=0.08)
    return functools.cache(functools.partial(step_with, (loaded, *fit_model(loaded, 0, silent))))


def tied(found, *names: str) -> tuple:
    """A study, a step in which these could not be told apart, one that found a lag besides, and the fit with both."""
    study, last, fit = found(names[0], LAG)
    (one,) = last.candidates
    settings = [EffectSetting.typical(effect_of(name, fit.problem.gripper)) for name in names]
    candidates = [
        dataclasses.replace(one, setting=setting, gains=np.ones(len(fit.residual)), signature=np.eye(len(names))[i])
        for i, setting in enumerate(settings)
    ]
    return study, [Step(names, tuple(candidates), (), 9.0, 5.0), last], fit


def names_in(fit) -> set[str]:
    return {one.effect.name for one in fit.problem.effects}


@pytest.mark.long
def test_a_rival_that_the_whole_model_rejects_goes(found):
    study, steps, fit = tied(found, FRICTION, DEADBAND)
    left, same = ask_again(study, steps, fit)
    assert [step.effects for step in left] == [(FRICTION,), (LAG,)]
    assert same is fit
    assert left[1].error_after == pytest.approx(study.error(study.heldout(fit)))


@pytest.mark.long
def test_a_rival_stays_where_more_is_left_than_tells_it_apart(found, monkeypatch):
    study, steps, fit = tied(found, FRICTION, DEADBAND)
    monkeypatch.setattr(Target, "beyond_noise", lambda target, residual: 1e9)
    left, _ = ask_again(study, steps, fit)
    assert [step.effects for step in left] == [(FRICTION, DEADBAND), (LAG,)]


@pytest.mark.long
def test_a_rival_that_does_better_takes_the_place(found):
    study, steps, fit = tied(found, DEADBAND, FRICTION)
    left, better = ask_again(study, steps, fit)
    assert [step.effects for step in left] == [(FRICTION,), (LAG,)]
    assert names_in(better) == {FRICTION, LAG}
    assert better.cost < 0.9 * fit.cost
    assert left[0].candidates[0].effect.name == FRICTION
    assert left[1].error_after == pytest.approx(study.error(study.heldout(better)))


@pytest.mark.long
def test_what_the_whole_model_can_not_tell_apart_stays_tied(found):
    study, steps, fit = tied(found, FRICTION, "presliding")
    left, same = ask_again(study, steps, fit)
    assert left == steps
    assert same is fit


@pytest.mark.long
def test_one_of_its_family_that_does_better_takes_the_place(found):
    study, (step, last), fit = tied(found, "load_friction")
    one = dataclasses.replace(step.candidates[0], signature=np.eye(1, fit.residual.size)[0])
    steps = [dataclasses.replace(step, candidates=(one,)), last]
    friction, deadband = (effect_of(name, fit.problem.gripper) for name in (FRICTION, DEADBAND))
    left, better = ask_again(study, steps, fit, [deadband, friction])
    assert [step.effects for step in left] == [(FRICTION,), (LAG,)]
    assert names_in(better) == {FRICTION, LAG}
    assert better.cost < 0.9 * fit.cost
    assert [c.effect.name for c in left[0].candidates] == [FRICTION, "load_friction"]
    assert ask_again(study, steps, fit, [deadband]) == (steps, fit)


def test_of_the_last_step_all_was_in_the_model(found, monkeypatch):
    study, steps, fit = tied(found, FRICTION, DEADBAND)
    monkeypatch.setattr("forcegrasp.diagnosis.search.ask_again._asked", lambda *_: pytest.fail("asked again"))
    alone = [dataclasses.replace(steps[0], effects=(FRICTION,)), dataclasses.replace(steps[1], effects=(LAG, DEADBAND))]
    assert ask_again(study, alone, fit) == (alone, fit)


@pytest.mark.long
def test_what_was_found_at_once_is_asked_among_look_alikes_of_any_family(found, monkeypatch):
    study, steps, fit = tied(found, FRICTION)
    asked = []

    def with_rivals(study, step, rivals, fit):
        asked.append((step.effects[0], [one.effect.name for one in rivals]))
        return step, fit

    monkeypatch.setattr("forcegrasp.diagnosis.search.ask_again._asked", with_rivals)
    at_once = [dataclasses.replace(s, candidates=(dataclasses.replace(s.candidates[0], without=fit),)) for s in steps]
    alike = [effect_of(name, fit.problem.gripper) for name in (DEADBAND, "command_delay")]
    ask_again(study, at_once, fit, alike)
    assert (FRICTION, [DEADBAND]) not in asked
    monkeypatch.setattr("forcegrasp.diagnosis.search.ask_again.AS_GOOD", np.inf)
    ask_again(study, at_once, fit, alike)
    assert (FRICTION, [DEADBAND]) not in asked  # its signature promises too little
    monkeypatch.setattr("forcegrasp.diagnosis.search.ask_again.promising", lambda study, fit, name, effects: effects)
    ask_again(study, at_once, fit, alike)
    assert (FRICTION, [DEADBAND]) in asked
    assert (LAG, ["command_delay"]) in asked  # the last of them, too


@pytest.mark.parametrize("at_once", [True, False])
def test_where_noise_alone_is_left_only_the_set_is_asked_in_the_place_of_what_was_found_at_once(
    found, monkeypatch, at_once
):
    """A gap of 0.3 mm and friction were friction and objects that are 0.15 mm smaller, without a word of the gap."""
    study, steps, fit = tied(found, FRICTION)
    asked = []

    def in_its_place(study, step, fit, effects, **_):
        asked.append((step.effects[0], [one.name for one in effects]))
        return []

    monkeypatch.setattr("forcegrasp.diagnosis.search.ask_again._in_its_place", in_its_place)
    if at_once:
        steps = [dataclasses.replace(s, candidates=(dataclasses.replace(s.candidates[0], without=fit),)) for s in steps]
    others = [get_effect(name) for name in (DEADBAND, "object_size")]
    ask_again(study, steps, fit, others, at_floor=True)
    assert asked == ([(FRICTION, ["object_size"]), (LAG, ["object_size"])] if at_once else [(FRICTION, [])])


# --- which models are asked whether a move of what the set gives explains what they leave ---------------------------


def test_a_rival_is_asked_in_the_place_of_what_it_can_not_be_told_from(found):
    study, steps, fit = tied(found, FRICTION, DEADBAND)
    diagnosis = SimpleNamespace(fit=fit, steps=steps, target=study.target, folds=study.folds)
    own, rival = _models(diagnosis)
    assert (own.fit, own.steps, own.place) == (fit, steps, -1)
    assert names_in(rival.fit) == {DEADBAND, LAG}
    assert rival.price > own.price
    assert rival.place == 0
    assert rival.steps[0].effects == (DEADBAND, FRICTION)
    assert [c.effect.name for c in rival.steps[0].candidates] == [DEADBAND, FRICTION]
    assert rival.steps[1] is steps[1]


@pytest.mark.parametrize("rivals", [(FRICTION,), (FRICTION, LAG)])
def test_what_is_alone_or_in_the_model_already_has_no_rival_to_ask(found, rivals):
    study, steps, fit = tied(found, *rivals)
    diagnosis = SimpleNamespace(fit=fit, steps=steps, target=study.target, folds=study.folds)
    assert [one.fit for one in _models(diagnosis)] == [fit]


@pytest.mark.parametrize(("first", "other", "stays"), [(FRICTION, DEADBAND, False), (DEADBAND, FRICTION, True)])
def test_rivals_are_judged_as_their_own_move_has_them(found, first, other, stays):
    study, steps, fit = tied(found, first, other)
    models = list(_models(SimpleNamespace(fit=fit, steps=steps, target=study.target, folds=study.folds)))
    step, _ = _with_rivals_that_do_as_well(models[0], models, study)
    assert step.effects == ((first, other) if stays else (first,))
    own, rival = step.candidates
    assert (own.effect.name, rival.effect.name) == (first, other)
    assert (rival.heldout_gain > own.heldout_gain) == stays
    assert rival.error_after == pytest.approx(study.error(study.heldout(models[1].fit)))
