"""Fits are made with the scene's own steps where larger ones lead grasps astray."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

from forcegrasp.identify import base_fit, fit_set, larger_steps
from forcegrasp.identify.fit import with_own_slopes
from forcegrasp.identify.fit_set import apply_model, fit_model
from forcegrasp.identify.fitted_model import model_of
from forcegrasp.identify.larger_steps import lead_astray, with_larger_steps_again, with_own_steps
from forcegrasp.identify.local_slopes import LocalSlopes
from forcegrasp.identify.predict import predict
from forcegrasp.identify.problem import Problem
from forcegrasp.identify.progress import silent
from forcegrasp.identify.simulators import cheap_tier
from forcegrasp.identify.target import make_target
from forcegrasp.physics.gripper_file import load_gripper
from forcegrasp.replay.replay import Replay
from tests.light_set import light_set


@pytest.fixture(scope="module")
def loaded():
    return light_set(grasps=6, samples=40)


@pytest.mark.parametrize(("times", "astray"), [(0.0, False), (8.0, False), (12.0, True)])
def test_one_grasp_that_goes_another_way_tells(loaded, times, astray):
    target = make_target(loaded.measured, loaded.gripper)
    correction = np.zeros_like(target.signals)
    correction[3] = times * np.broadcast_to(target.sigma, target.signals.shape)[3]
    mask = target.mask.copy()
    mask[1, -1], correction[1, -1] = False, 1e9  # there is no such row
    part = SimpleNamespace(mask=mask, sigma=target.sigma)
    assert lead_astray(SimpleNamespace(correction=correction), part) == astray


def test_own_steps_have_no_cheaper_ones():
    gripper = load_gripper("franka_hand")
    own = with_own_steps(gripper)
    assert (cheap_tier(gripper), cheap_tier(gripper, "screening")) == ("fitting", "screening")
    assert (cheap_tier(own), cheap_tier(own, "screening")) == ("reference", "reference")
    assert not gripper.own_steps


def test_a_set_is_fitted_again_with_own_steps(loaded, monkeypatch):
    asked, told = [], []

    def astray(fit, target):
        asked.append(target.gripper.own_steps)
        return not target.gripper.own_steps

    for module in (fit_set, base_fit):
        monkeypatch.setattr(module, "lead_astray", astray)
    target, simulators, base = fit_model(loaded, 0, told.append)
    assert (target.gripper.own_steps, simulators.one_model) == (True, True)
    assert base.fit.problem.gripper is target.gripper
    assert asked[:2] == [False, False]  # before other starts, and of what came of it
    assert sum("start 2" in line for line in told) == 1
    assert any("with the scene's own" in line for line in told)
    model = model_of(base.fit, target, loaded, ())
    known, simulators, _ = apply_model(loaded, model, silent, refit=True)
    assert (known.gripper.own_steps, simulators.one_model) == (True, True)
    asked.clear()
    apply_model(loaded, model, silent, refit=False)
    assert not asked  # nothing is fitted


def test_a_fit_ends_with_slopes_of_the_model_itself(loaded):
    """Those of larger steps leave it beside the optimum."""
    target, simulators, base = fit_model(loaded, 0, silent, hasty=True)
    told, fit = [], base.fit
    assert with_own_slopes(fit, target, simulators, told.append) is fit  # there is only one model
    simulators.exact = simulators.at_the_end = Replay(loaded.gripper, target.grasps, step_factor=0.5)
    own = with_own_slopes(fit, target, simulators, told.append)
    assert told == ["base model, with the scene's own steps"]
    of_own = LocalSlopes(target, fit.problem, simulators.exact, simulators.exact, None, simulators.step)
    assert own.jacobian == pytest.approx(of_own.slopes(own.vector, anew=True))
    assert own.jacobian != pytest.approx(fit.jacobian)
    before = target.residual(predict(simulators.exact, [fit.problem.case(fit.vector)])[0])
    assert own.cost <= np.sum(before**2)
    simulators.at_the_end = simulators.cheap  # somebody compared them
    assert with_own_slopes(fit, target, simulators) is fit


@pytest.mark.parametrize("hasty", [True, False])
def test_a_hasty_fit_does_not(loaded, hasty, monkeypatch):
    asked = []
    monkeypatch.setattr(fit_set, "with_own_slopes", lambda fit, *_: asked.append(fit) or fit)
    _, _, base = fit_model(loaded, 0, silent, hasty)
    assert asked == ([] if hasty else [base.fit])


def test_larger_steps_come_back_where_grasps_go_the_same_way(loaded, monkeypatch):
    quick = dataclasses.replace(loaded.gripper, fast="sphere")
    own = dataclasses.replace(loaded, gripper=with_own_steps(quick))
    target, simulators, base = fit_model(own, 0, silent)
    fit = base.fit
    assert simulators.one_model
    assert not fit.correction.any()
    monkeypatch.setattr(larger_steps, "lead_astray", lambda fit, target: False)
    again = with_larger_steps_again(fit, target)
    assert again is not None
    target_then, simulators_then, fit_then = again
    assert target_then.gripper is fit_then.problem.gripper
    assert (target_then.gripper.own_steps, simulators_then.one_model) == (False, False)
    assert (fit_then.vector is fit.vector, fit_then.cost) == (True, fit.cost)
    cheap = predict(simulators_then.cheap, [fit_then.problem.case(fit.vector)])[0]
    assert np.allclose(fit_then.predicted, cheap + fit_then.correction)
    assert fit_then.correction.any()
    monkeypatch.setattr(larger_steps, "lead_astray", lambda fit, target: True)
    assert with_larger_steps_again(fit, target) is None


def test_there_are_none_to_come_back_to_without_a_cheaper_simulation(loaded):
    own = with_own_steps(loaded.gripper)
    target = make_target(loaded.measured, own)
    assert with_larger_steps_again(SimpleNamespace(problem=Problem(own, target.grasps)), target) is None
