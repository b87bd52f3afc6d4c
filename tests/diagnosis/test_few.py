"""Few grasps that stand for all: which they are, what is simulated on them, and what on all."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from forcegrasp.diagnosis import signatures
from forcegrasp.diagnosis.few import few_grasps, with_few
from forcegrasp.diagnosis.search.refine import _adds_nothing, _in_the_race
from forcegrasp.diagnosis.search.screen import Screen
from forcegrasp.diagnosis.signatures import Background
from forcegrasp.diagnosis.study import Study
from forcegrasp.effects import get_effect
from forcegrasp.effects.setting import EffectSetting
from forcegrasp.identify.fit import Fit
from forcegrasp.identify.problem import Problem
from forcegrasp.identify.simulators import Simulators
from forcegrasp.identify.target import Target

#: Where sixteen grasps leave most: the second ones of the made-up set's eight.
WORST = 3


@pytest.fixture(scope="module")
def many(made_up) -> SimpleNamespace:
    """The made-up set twice, with other names: two objects, eight grasps of each."""
    target, fit = made_up.target, made_up.base.fit
    grasps = [*target.grasps, *(dataclasses.replace(g, name=f"{g.name} again") for g in target.grasps)]
    twice = {name: np.tile(getattr(target, name), (2, 1, 1)) for name in ("signals", "weight")}
    masks = {name: np.tile(getattr(target, name), (2, 1)) for name in ("mask", "phase")}
    target = dataclasses.replace(target, grasps=tuple(grasps), **twice, **masks)
    problem = Problem(fit.problem.gripper, grasps)
    arrays = {name: np.concatenate([getattr(fit, name)] * 2) for name in ("predicted", "residual", "jacobian")}
    arrays |= {name: np.concatenate([getattr(fit, name)] * 2) for name in ("correction", "weight")}
    fit = dataclasses.replace(fit, problem=problem, **arrays)
    return SimpleNamespace(target=target, fit=fit, study=Study(target, Simulators(problem), ()))


def only(fit: Fit, grasps: np.ndarray) -> Fit:
    """The fit, leaving something in these grasps and nothing in others."""
    left = np.zeros_like(fit.residual)
    left[grasps] = 10.0
    return dataclasses.replace(fit, residual=left)


def test_a_third_of_each_objects_grasps_with_the_worst_one(many):
    keep = few_grasps(many.target, many.fit)
    assert len(keep) == 6
    assert list(keep) == sorted(set(keep))
    assert [sum(many.target.grasps[i].object == name for i in keep) for name in many.target.objects] == [3, 3]
    assert WORST in keep
    for worst in range(16):
        assert worst in few_grasps(many.target, only(many.fit, np.array([worst])))


@pytest.fixture(scope="module")
def six(made_up) -> SimpleNamespace:
    """Six of the made-up set's grasps: as few as may be."""
    keep = np.arange(6)
    fit = made_up.base.fit.subset(keep)
    return SimpleNamespace(fit=fit, study=Study(made_up.target.subset(keep), Simulators(fit.problem), ()))


def test_a_spike_makes_no_grasp_the_worst(many):
    left = only(many.fit, np.array([5])).residual
    left[5] /= 5.0  # 2 σ everywhere
    left[7, 3, 0] = 60.0
    keep = few_grasps(many.target, dataclasses.replace(many.fit, residual=left))
    assert many.target.grasps[5].object == many.target.grasps[7].object
    assert 5 in keep


def test_of_few_grasps_all_are_taken(six):
    assert with_few(six.study, six.fit) is six.study
    assert six.study.on_few(six.fit) == (six.study, six.fit)


def test_few_grasps_are_ranked_by_with_the_largest_steps(many):
    some, _ = with_few(many.study, many.fit).on_few(many.fit)
    assert (some.rough.tier, some.simulators.cheap.tier, many.study.rough) == ("screening", "fitting", None)
    exactly = dataclasses.replace(many.study, simulators=Simulators(many.fit.problem, exact=True))
    some, _ = with_few(exactly, many.fit).on_few(many.fit)
    assert some.rough is some.simulators.exact


@pytest.mark.parametrize(
    ("gains", "kept"), [([100.0, 69.0, 71.0, -5.0], [0, 2]), ([50.0], [0]), ([-1.0, -2.0], [0]), ([], [])]
)
def test_what_gains_far_less_on_few_grasps_has_lost(gains, kept):
    assert _in_the_race(gains, 0.7) == kept


@pytest.mark.parametrize(
    ("name", "cost", "lost"), [("stiction", 99.5, True), ("stiction", 98.0, False), ("force_lag", 99.5, False)]
)
def test_what_adds_nothing_to_an_effect_that_it_contains_is_not_fitted_on_all(name, cost, lost):
    simple, one = (
        cast(Any, SimpleNamespace(cost=cost, problem=SimpleNamespace(effects=[EffectSetting.typical(get_effect(of))])))
        for of, cost in (("coulomb_friction", 100.0), (name, cost))
    )
    assert _adds_nothing(one, [one, simple]) is lost
    assert not _adds_nothing(simple, [one, simple])


def test_few_grasps_stay_until_they_do_not_show_what_is_left(many):
    study = with_few(many.study, many.fit)
    keep = study.few.keep
    assert with_few(study, many.fit) is study
    assert with_few(study, only(many.fit, keep)) is study
    elsewhere = only(many.fit, np.setdiff1d(np.arange(16), keep))
    others = with_few(study, elsewhere).few.keep
    assert not np.array_equal(others, keep)
    assert np.any(elsewhere.residual[others])


def test_a_fit_of_few_grasps_says_the_same_of_them(many):
    some, part = with_few(many.study, many.fit).on_few(many.fit)
    keep = few_grasps(many.target, many.fit)
    assert [g.name for g in some.target.grasps] == [many.target.grasps[i].name for i in keep]
    np.testing.assert_array_equal(part.residual, many.fit.residual[keep])
    np.testing.assert_array_equal(some.target.residual(part.predicted), many.target.residual(many.fit.predicted)[keep])
    assert [e.name for e in part.problem.entries] == [e.name for e in many.fit.problem.entries]
    assert len(some.simulators.cheap.grasps) == len(keep)
    moved = many.fit.moved(part.problem, part.vector + np.arange(len(part.vector)))
    np.testing.assert_allclose(moved - many.fit.vector, np.arange(len(part.vector)))


def test_an_object_that_is_not_among_them_keeps_its_parameters(many):
    part = many.fit.subset(np.flatnonzero([g.object == "thing 1" for g in many.target.grasps]))
    moved = many.fit.moved(part.problem, part.vector + 1.0)
    for entry, change in zip(many.fit.problem.entries, moved - many.fit.vector, strict=True):
        assert change == (0.0 if entry.name.endswith("thing 0") else 1.0)


@pytest.fixture
def simulated(many, monkeypatch) -> list[tuple[int, list[str]]]:
    """On how many grasps which effects were simulated; a bias explains all, a lag nothing, a gain leaves no trace."""
    calls = []

    def changes(tried, study: Study, fit: Fit) -> np.ndarray:
        calls.append((len(study.target.grasps), [one.effect.name for one in tried]))
        rng, shape = np.random.default_rng(len(calls)), fit.residual.shape
        kinds = {"force_bias": fit.residual, "force_lag": rng.standard_normal(shape), "force_gain": np.zeros(shape)}
        return np.stack([kinds[name].ravel() for name in calls[-1][1]], axis=1)

    monkeypatch.setattr(signatures, "_changes", changes)
    return calls


class _Named:
    """An effect of which only the name counts."""

    def __init__(self, name: str) -> None:
        self.name = name

    variants = ("",)
    parameters = get_effect("force_lag").parameters

    def trials(self) -> np.ndarray:
        return np.ones((1, 1))


def test_what_promises_something_or_shows_nothing_on_few_is_simulated_on_all(many, simulated):
    effects: Any = [_Named(name) for name in ("force_bias", "force_lag", "force_gain")]
    study, rng = with_few(many.study, many.fit), np.random.default_rng(0)
    screen = Screen(effects, study)
    look = screen.look(study, many.fit, Background(many.fit, ()), effects, None, rng)
    assert simulated == [(6, ["force_bias", "force_lag", "force_gain"]), (16, ["force_bias", "force_gain"])]
    assert [score.setting.effect.name for score in look.scores] == ["force_bias", "force_lag"]
    assert [score.setting.effect.name for score in look.worth_a_fit] == ["force_bias"]
    assert len(look.worth_a_fit[0].signature) == many.fit.residual.size
    assert look.share_together > 0.9
    screen.look(study, many.fit, Background(many.fit, ()), effects, None, rng)
    assert simulated[2:] == [(16, ["force_bias"])]  # in the next round only what promises something


def test_where_few_are_all_nothing_is_simulated_twice(six, simulated):
    effects: Any = [_Named("force_bias"), _Named("force_lag")]
    Screen(effects, six.study).look(
        six.study, six.fit, Background(six.fit, ()), effects, None, np.random.default_rng(0)
    )
    assert [call for call in simulated if call[1]] == [(6, ["force_bias", "force_lag"])]


def test_squares_beyond_the_noise(many):
    target: Target = many.target
    noise = np.random.default_rng(2).standard_normal(many.fit.residual.shape) * target.mask[..., None]
    assert abs(target.beyond_noise(noise)) < 4 * np.sqrt(2 * target.readings)
    assert target.beyond_noise(2 * noise) == pytest.approx(3 * target.readings, rel=0.05)
