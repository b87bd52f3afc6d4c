"""One effect takes the place of two that were found, where held-out grasps do not ask for both."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from forcegrasp.diagnosis.families import _best_start
from forcegrasp.diagnosis.result import Candidate, Step
from forcegrasp.diagnosis.search.exchange import are_alike
from forcegrasp.diagnosis.search.merge import _like_both, _roughly_as_good, merge, promising
from forcegrasp.diagnosis.study import Study
from forcegrasp.effects import get_effect
from forcegrasp.effects.for_gripper import effect_of, effects_of
from forcegrasp.effects.setting import EffectSetting
from forcegrasp.identify.cross_validation import make_folds
from forcegrasp.identify.fit import fit_exactly
from forcegrasp.identify.fit_set import fit_model
from forcegrasp.identify.noise_floor import beyond_fit, numerical_error
from forcegrasp.identify.problem import Problem
from forcegrasp.identify.progress import silent
from forcegrasp.identify.simulators import Simulators
from tests.light_set import light_gripper, light_set

LATE = ("readout_skew", "force_delay")
MERGE = "forcegrasp.diagnosis.search.merge"
NEEDLESS = "forcegrasp.diagnosis.search.needless"
CATALOGUE = list(effects_of(light_gripper()).values())


def explained_by_late_readings(*hidden: str):
    """A study of a set with these effects hidden, a step for each of two that are not, or are, and the fit of both."""
    loaded = light_set(*hidden, grasps=6)
    target, simulators, base = fit_model(loaded, 0, silent)
    study = Study(
        target, simulators, make_folds(target.grasps), beyond_fit(base.fit, numerical_error(base.fit, target))
    )
    settings = [EffectSetting(get_effect(name), "", np.array([0.015])) for name in LATE]
    problem = Problem(loaded.gripper, target.grasps, settings)
    fit = fit_exactly(target, problem, Simulators(problem), np.r_[base.fit.vector, problem.start()[-len(LATE) :]])
    steps, errors = [], [9.0, 4.0, study.error(study.heldout(fit))]
    for setting, before, after in zip(problem.case(fit.vector).effects, errors[:-1], errors[1:], strict=True):
        one = Candidate(setting, fit, 0.002, np.ones(6), after, 0.9, 0.5, np.ones(1))
        steps.append(Step((setting.effect.name,), (one,), (), before, after))
    return study, steps, fit


@pytest.fixture(scope="module")
def late():
    """A late command, explained by positions and forces that are read late."""
    return explained_by_late_readings("command_delay delay_s=0.016")


def test_a_late_command_stands_for_late_positions_and_late_forces(late):
    study, steps, fit = late
    nothing = dataclasses.replace(steps[1], effects=(), error_before=steps[1].error_after)
    left, less = merge(study, [*steps, nothing], fit, CATALOGUE, 0)
    assert [step.effects for step in left] == [("command_delay",), ()]
    assert [one.effect.name for one in less.problem.effects] == ["command_delay"]
    (found,) = left[0].candidates
    assert found.setting.values == pytest.approx([0.016], abs=0.001)
    assert found.fit is less
    assert found.heldout_gain == 12
    error = study.error(study.heldout(less))
    assert (left[0].error_before, left[0].error_after, left[1].error_before) == (9.0, error, error)
    assert error < 1.02 * steps[1].error_after


def test_what_promises_less_than_half_of_what_both_explain_is_not_fitted(late, monkeypatch):
    study, _, fit = late
    delay, *others = (effect_of(name, light_gripper()) for name in ("command_delay", "force_bias", "force_drift"))
    assert promising(study, fit, LATE, [delay, *others]) == [delay]
    monkeypatch.setattr(f"{MERGE}._PROMISE", -1.0)
    assert set(promising(study, fit, LATE, [delay, *others])) > {delay}


def test_what_was_given_stays(late):
    study, steps, fit = late
    assert merge(study, steps, fit, CATALOGUE, 1) == (steps, fit)


def test_two_that_are_there_stay():
    study, steps, fit = explained_by_late_readings("readout_skew delay_s=0.008", "force_delay delay_s=0.03")
    assert merge(study, steps, fit, CATALOGUE, 0) == (steps, fit)


def test_of_two_that_look_alike_no_promise_is_asked(late, monkeypatch):
    study, steps, fit = late
    monkeypatch.setattr(f"{MERGE}.promising", lambda *_: [])
    assert len(merge(study, steps, fit, CATALOGUE, 0)[0]) == 1
    unlike = lambda one, other: are_alike(one, other) and {one.name, other.name} != set(LATE)  # noqa: E731
    monkeypatch.setattr(f"{MERGE}.are_alike", unlike)
    assert merge(study, steps, fit, CATALOGUE, 0) == (steps, fit)


@pytest.mark.parametrize(("left", "share", "enough"), [("", 0.9, True), ("in all", 0.9, False), ("in all", 0.1, True)])
def test_one_does_for_two_that_are_surely_better_if_it_leaves_nothing_or_they_hardly_less(
    late, monkeypatch, left, share, enough
):
    """Two delays make up for a fraction of a physics step, too, by which one reading is older than another."""
    study, _, fit = late
    monkeypatch.setattr(f"{NEEDLESS}.is_beyond_chance", lambda *_: True)
    monkeypatch.setattr(f"{NEEDLESS}.excess", lambda *_: left)
    monkeypatch.setattr(Study, "explained", lambda *_: share)
    delay = effect_of("command_delay", light_gripper())
    assert (_roughly_as_good(study, fit, LATE, delay) is not None) == enough


def test_an_effect_in_the_place_of_others_begins_at_the_best_of_many_sizes(late):
    """From one far off, what other parameters make up for leads elsewhere."""
    study, _, fit = late
    delay = effect_of("command_delay", light_gripper())
    far = [EffectSetting(delay, "", np.array([seconds])) for seconds in (0.05, 0.12)]
    problem, start, _ = _best_start(far, fit, LATE, study)
    assert problem.case(start).effects[-1].values == pytest.approx([0.016], rel=0.15)
    problem, start, _ = _best_start(far[:1], fit, LATE, study)
    assert problem.case(start).effects[-1].values == pytest.approx([0.05])


def test_one_of_two_of_a_family_may_do_for_both():
    """A gap of 0.4 mm was 0.12 mm of one kind of backlash, found first, and 0.33 mm of the other."""

    def alike(*names: str) -> set[str]:
        settings = [EffectSetting.typical(effect_of(name, light_gripper())) for name in names]
        fit = cast(Any, SimpleNamespace(problem=SimpleNamespace(effects=settings)))
        return {effect.name for effect in _like_both(names, fit, CATALOGUE)}

    assert alike("backlash", "two_mass_backlash") >= {"backlash", "two_mass_backlash", "backlash_asymmetry"}
    assert not {"backlash", "coulomb_friction"} & alike("backlash", "coulomb_friction")
    assert not {"backlash", "encoder_bias"} & alike("backlash", "encoder_bias"), "they look alike, of two families"


@pytest.mark.parametrize(("pair", "enough"), [(("backlash", "two_mass_backlash"), True), (LATE, False)])
def test_one_of_two_whose_cost_has_valleys_is_not_judged_by_a_rough_fit(monkeypatch, pair, enough):
    rough = SimpleNamespace(effects=["it"], residual=None)
    monkeypatch.setattr(f"{MERGE}.roughly_as", lambda *_, **__: rough)
    monkeypatch.setattr(f"{MERGE}.asks_for_more", lambda *_: True)
    effect, nothing = effect_of(pair[1], light_gripper()), cast(Any, SimpleNamespace(residual=None))
    assert (_roughly_as_good(nothing, nothing, pair, effect) is not None) == enough
