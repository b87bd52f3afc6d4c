"""An effect that was found too early gives way to the one that it looks like; what is true stays."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
import pytest

from forcegrasp.diagnosis.families import roughly_without
from forcegrasp.diagnosis.noise.noise_check import Noise
from forcegrasp.diagnosis.result import Step, kept_steps
from forcegrasp.diagnosis.search.exchange import are_alike, exchange
from forcegrasp.diagnosis.search.screen import Screen
from forcegrasp.diagnosis.search.search import diagnose
from forcegrasp.diagnosis.search.step import look_further
from forcegrasp.effects import catalogue, get_effect
from forcegrasp.effects.for_gripper import effect_of, effects_of
from forcegrasp.identify.fit_set import fit_model
from forcegrasp.identify.noise_floor import beyond_fit, numerical_error
from tests.diagnosis.test_families import jaw_with, silent
from tests.diagnosis.test_needless import step_with


@pytest.fixture(scope="module")
def rubbing():
    """A jaw with dry friction, and its base model."""
    loaded = jaw_with("coulomb_friction", force_n=0.08)
    return loaded, *fit_model(loaded, 0, silent)


@pytest.fixture(scope="module")
def found(rubbing):
    """:func:`step_with` of that jaw, each made once."""
    return functools.cache(functools.partial(step_with, rubbing))


def exchanged(found, *names: str, only_last: bool = False):
    """What takes the place of one of these effects, which are in the model; and the step that found the last one."""
    study, step, fit = found(*names)
    study = dataclasses.replace(study, numerical=beyond_fit(fit, numerical_error(fit, study.target)))
    step = dataclasses.replace(step, error_after=study.error(study.heldout(fit)))
    steps = [step] if only_last else [dataclasses.replace(step, effects=(name,)) for name in names]
    others = [e for e in effects_of(fit.problem.gripper).values() if e.name in ("coulomb_friction", "encoder_bias")]
    others = [e for e in others if e.name not in names]
    screen = Screen(others, study)
    return exchange(study, fit, screen, others, steps, np.random.default_rng(0)), steps


@pytest.mark.long
def test_what_was_hidden_takes_the_place_of_its_look_alike(found):
    taken, steps = exchanged(found, "actuator_lag", "position_deadband")
    assert taken is not None
    best = taken.candidates[0]
    assert (taken.effects[0], best.replaces) == ("coulomb_friction", "position_deadband")
    assert [one.effect.name for one in best.fit.problem.effects] == ["actuator_lag", "coulomb_friction"]
    assert taken.error_before == pytest.approx(steps[-1].error_after)
    assert taken.error_after == best.error_after < 1.1 < taken.error_before
    assert best.share > 0.9
    assert [step.effects[0] for step in kept_steps([*steps, taken])] == ["actuator_lag", "coulomb_friction"]


def test_what_is_true_stays(found):
    assert exchanged(found, "actuator_lag", "coulomb_friction")[0] is None


def test_the_only_effect_was_chosen_with_all_there_is_in_the_model(found, monkeypatch):
    monkeypatch.setattr(
        "forcegrasp.diagnosis.search.exchange.look_further", lambda *_, **__: pytest.fail("looked for another")
    )
    assert exchanged(found, "position_deadband", only_last=True)[0] is None


@pytest.mark.parametrize(("other", "tried"), [("object_size", True), ("coulomb_friction", True), ("force_lag", False)])
def test_look_alikes_are_tried_and_mistakes_of_the_set(found, monkeypatch, other, tried):
    """A mistake may look like anything: radii that were too large were called friction."""
    asked = []

    def nothing(study, fit, screen, effects, rng, most) -> Step:
        asked.extend(effects)
        return Step((), (), (), 1.0, 1.0)

    monkeypatch.setattr("forcegrasp.diagnosis.search.exchange.look_further", nothing)
    study, step, fit = found("actuator_lag", "position_deadband")
    steps = [dataclasses.replace(step, effects=("position_deadband",)), step]
    one = get_effect(other)
    assert exchange(study, fit, Screen([one], study), [one], steps, np.random.default_rng(0)) is None
    assert (one in asked) == tried


@pytest.mark.long
def test_what_would_leave_far_more_is_not_fitted_to_the_end(found):
    study, _, fit = found("actuator_lag", "position_deadband")
    friction = get_effect("coulomb_friction")
    without = roughly_without("position_deadband", fit, study)

    def fitted(most: float) -> list[float]:
        look = look_further(study, without, Screen([friction], study), [friction], np.random.default_rng(0), most=most)
        return [candidate.fit.cost for candidate in look.candidates]

    (cost,) = fitted(np.inf)
    assert fitted(cost) == [cost]
    assert fitted(cost - 0.1 * without.cost) == []


def test_alike_are_look_alikes_either_way_and_effects_of_one_kind():
    rate, force, friction = (get_effect(n) for n in ("rate_limit", "force_limit", "coulomb_friction"))
    assert are_alike(rate, force)
    assert not are_alike(rate, friction)
    for one in catalogue().values():
        assert all(are_alike(one, other) == are_alike(other, one) for other in catalogue().values())
        assert all(are_alike(one, get_effect(name)) for name in one.look_alikes)


@pytest.mark.long
def test_a_search_that_ends_with_more_than_noise_looks_for_exchanges_and_goes_on(rubbing, found, monkeypatch):
    _, target, simulators, base = rubbing
    names = ("actuator_lag", "position_deadband")
    _, step, fit = found(*names)
    _, instead, other_fit = found("actuator_lag", "coulomb_friction")
    taken = dataclasses.replace(instead, error_before=step.error_after)
    candidate = dataclasses.replace(instead.candidates[0], fit=other_fit, replaces="position_deadband")
    calls = []

    def recorded(*arguments) -> Step | None:
        calls.append(arguments)
        return dataclasses.replace(taken, candidates=(candidate,)) if len(calls) == 1 else None

    monkeypatch.setattr("forcegrasp.diagnosis.search.search.exchange", recorded)
    steps = [dataclasses.replace(step, effects=(name,)) for name in names]
    other = [effect_of("motor_offset", target.gripper)]
    diagnosis = diagnose(target, base, simulators, other, np.random.default_rng(0), start=(fit, steps))
    assert calls
    assert "coulomb_friction" in diagnosis.preferred
    assert "position_deadband" not in diagnosis.preferred


@pytest.mark.parametrize(("times", "looks"), [(1.5, 3), (0.7, 1)])  # the last one by signatures made anew
def test_the_search_goes_on_where_noise_seems_to_be_stronger_than_said(rubbing, monkeypatch, times, looks):
    """An effect that is missing may look like such noise, and then it would never be looked for."""
    _, target, simulators, base = rubbing
    signals = np.ones(target.signals.shape[-1])
    noise = Noise(times * signals, times * signals, signals > 0, 0 * signals, 0 * signals)
    monkeypatch.setattr("forcegrasp.diagnosis.search.left_over.left_over", lambda *_: ("", noise))
    looked = []

    def recorded(*arguments, anyway: bool = False, **more) -> Step:
        looked.extend([] if anyway else [arguments])
        return look_further(*arguments, anyway=anyway, **more)

    monkeypatch.setattr("forcegrasp.diagnosis.search.search.look_further", recorded)
    chosen = [effect_of(name, target.gripper) for name in ("coulomb_friction", "motor_offset")]
    diagnosis = diagnose(target, base, simulators, chosen, np.random.default_rng(0))
    assert diagnosis.preferred[0] == "coulomb_friction"
    assert len(looked) == looks
