"""Where objects stood, where what is left falls and rises with their places more than once."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from forcegrasp.diagnosis.faults import seen_places as of_trials
from forcegrasp.diagnosis.faults import tolerance
from forcegrasp.diagnosis.faults.seen_places import seen_places
from forcegrasp.diagnosis.faults.tolerance import wanted_moves
from forcegrasp.identify.fit import Fit, fit_once
from forcegrasp.identify.fit_set import fit_model
from forcegrasp.identify.problem import Problem
from forcegrasp.identify.progress import silent
from forcegrasp.identify.simulators import Simulators
from forcegrasp.identify.target import Target, make_target
from tests.light_set import light_set

STD_M, APART_M, JOLT = 5e-4, 3e-4, 20.0


@pytest.fixture(scope="module")
def fitted() -> tuple[Target, Fit]:
    """A set and the base model beside it, as it is before any fit."""
    loaded = light_set()
    target = make_target(loaded.measured, loaded.gripper)
    problem = Problem(loaded.gripper, target.grasps)
    fit = fit_once(target, problem, Simulators(problem), problem.start(), free=np.zeros(len(problem), bool))
    return target, fit


@pytest.fixture
def jolts(fitted, monkeypatch) -> tuple[Target, Fit, np.ndarray]:
    """Grasps of which one reading tells the place; the second object stood 0.335 mm further left than said."""
    target, fit = fitted
    told = np.array([grasp.offset_m for grasp in target.grasps])
    stood = told.copy()
    stood[1] -= 3.35e-4

    def jolt(offset_m: np.ndarray, off_m: np.ndarray) -> np.ndarray:
        valley = 1 - np.cos(2 * np.pi * (offset_m - off_m) / APART_M)
        return valley + np.abs(offset_m - off_m) / STD_M  # the right one is the deepest

    def predict(replay, cases):
        of_part = [list(told).index(grasp.offset_m) for grasp in replay.grasps]
        samples = max(len(grasp.time_s) for grasp in replay.grasps)
        signals = np.repeat(target.signals[None, of_part, :samples], len(cases), axis=0)
        for row, case in enumerate(cases):
            signals[row, :, 20, -1] -= JOLT * target.sigma[-1] * jolt(case.base["offset_m"], stood[of_part])
        return signals

    monkeypatch.setattr(of_trials, "predict", predict)
    residual = np.zeros_like(fit.residual)
    residual[:, 20, -1] = JOLT * jolt(told, stood)
    noise = np.random.default_rng(0).normal(size=residual.shape) * target.mask[..., None]
    return target, dataclasses.replace(fit, residual=residual + noise, correction=np.zeros_like(fit.residual)), told


def test_a_place_is_found_beyond_a_rise(jolts):
    target, fit, _ = jolts
    members, none = np.arange(len(target.grasps)), np.zeros(len(target.grasps))
    found = seen_places(target, fit, members, none, STD_M)
    assert found[1] * STD_M == pytest.approx(-3.35e-4, abs=0.03 * STD_M)
    assert not np.delete(found, 1).any()


def test_a_grasp_that_leaves_no_more_than_noise_keeps_its_place(jolts):
    target, fit, _ = jolts
    quiet = dataclasses.replace(fit, residual=np.clip(fit.residual, -3, 3))
    assert not seen_places(target, quiet, np.array([1]), np.zeros(1), STD_M).any()


def test_of_places_that_leave_as_much_the_one_that_was_said_is_kept(jolts, monkeypatch):
    target, fit, _ = jolts
    signals = target.signals
    monkeypatch.setattr(of_trials, "predict", lambda replay, cases: np.repeat(signals[None, [1]], len(cases), axis=0))
    assert seen_places(target, fit, np.array([1]), np.array([0.8]), STD_M) == pytest.approx([0.0], abs=1e-9)


@pytest.mark.parametrize(("radius_off_m", "by_trial"), [(8e-5, True), (4e-4, False)])
def test_places_move_by_trial_where_radii_are_within_their_tolerance(fitted, monkeypatch, radius_off_m, by_trial):
    """From where the set has them, and not from where slopes lead; they would make up for radii further off."""
    asked, loaded = [], light_set()
    grasps = tuple(
        dataclasses.replace(
            g,
            offset_m=g.offset_m + 8e-4 * (g.name == "1"),
            radius_m=g.radius_m + radius_off_m * (g.object == "thing_0"),
        )
        for g in loaded.measured.grasps
    )
    loaded = dataclasses.replace(loaded, measured=dataclasses.replace(loaded.measured, grasps=grasps))
    target, _, base = fit_model(loaded, 0, silent, hasty=True)

    def one_place(target, fit, members, deviations, std_m):
        asked.append(deviations)
        return np.arange(len(members)) / 10

    monkeypatch.setattr(tolerance, "seen_places", one_place)
    moved = wanted_moves(loaded.measured, target, base.fit, worth=0.1)
    assert moved is not None
    assert bool(asked) == by_trial
    if by_trial:
        assert not asked[0].any()
        places = [by for given, by in zip(moved.numbers, moved.deviations, strict=True) if given.kind == "offset_m"]
        assert places == pytest.approx(np.arange(len(grasps)) / 10)
