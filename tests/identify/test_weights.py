"""Recordings of a servo count alike, however much of them a model misses."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from forcegrasp.identify.base_fit import BaseFit, rms_error
from forcegrasp.identify.cross_validation import heldout_residual, make_folds, rms
from forcegrasp.identify.fit import fit_exactly
from forcegrasp.identify.fit_set import _weighed, apply_model
from forcegrasp.identify.fitted_model import model_of
from forcegrasp.identify.loading import load
from forcegrasp.identify.problem import Problem
from forcegrasp.identify.simulators import Simulators
from forcegrasp.identify.target import make_target
from forcegrasp.identify.weights import reweigh
from tests.independent.slide import record


@pytest.fixture(scope="module")
def missed(tmp_path_factory: pytest.TempPathFactory) -> SimpleNamespace:
    """Two recordings of a slide whose drive is too slow for the commands of the first; the model doesn't know."""
    folder = tmp_path_factory.mktemp("weights") / "set"
    record(folder, {"rate_limit": {"speed": 0.01}}, 3, recordings=2, samples=500)
    loaded = load(folder)
    target = make_target(loaded.measured, loaded.gripper)
    problem = Problem(loaded.gripper, target.grasps)
    simulators = Simulators(problem)
    fit = fit_exactly(target, problem, simulators, problem.start())
    return SimpleNamespace(folder=folder, target=target, simulators=simulators, fit=fit)


def errors(fit, target) -> np.ndarray:
    return np.array([np.sqrt(np.mean(fit.residual[i][target.mask[i]] ** 2)) for i in target.recordings.values()])


def test_each_recording_counts_by_what_is_left_of_it(missed):
    before = errors(missed.fit, missed.target)
    target, fit = reweigh(missed.target, missed.fit, missed.simulators)
    after = errors(fit, target)
    easier = int(np.argmin(before))
    assert before.max() > 2 * before.min() > 2
    weights = np.array([target.weight[i[0], 0, 0] for i in target.recordings.values()])
    assert weights * after == pytest.approx(1.0, rel=0.25)
    assert after[easier] < before[easier]  # which the other one had decided
    assert fit.cost == pytest.approx(target.readings, rel=0.3)
    assert fit.gradient < 5


@pytest.mark.parametrize("agree", [True, False])
def test_a_fit_is_judged_by_its_weights_where_starts_agree(missed, agree):
    """Slopes of the motion that is missed by most had said that the error still falls."""
    unweighted = BaseFit(missed.fit, (), False, "why", starts_agree=agree)
    target, _, base = _weighed(missed.target, missed.simulators, unweighted)
    assert target is not missed.target
    assert base.converged == agree
    assert bool(base.reason) == (not agree)


def test_a_model_that_is_given_is_judged_as_the_fit_that_it_is_of(missed):
    """Held-out recordings are told apart by the others as these counted in the fit: else the fastest would decide."""
    target, _, base = _weighed(missed.target, missed.simulators, BaseFit(missed.fit, (), True))
    loaded = load(missed.folder)
    again, _, given = apply_model(loaded, model_of(base.fit, target, loaded, []), lambda text: None, refit=False)
    np.testing.assert_allclose(again.weight, target.weight, rtol=0.25)
    assert given.fit.weight is again.weight
    held = [rms(heldout_residual(f, t, make_folds(t.grasps)), t) for f, t in ((base.fit, target), (given.fit, again))]
    assert held[1] == pytest.approx(held[0], rel=0.05)


def test_one_recording_is_left_as_it_is(missed):
    members = next(iter(missed.target.recordings.values()))
    alone = missed.target.subset(members)
    fit = SimpleNamespace(residual=missed.fit.residual[members])
    assert reweigh(alone, fit, missed.simulators) == (alone, fit)


def test_an_error_is_that_of_a_typical_recording(missed):
    one, other = errors(missed.fit, missed.target)
    counts = [missed.target.mask[i].sum() for i in missed.target.recordings.values()]
    expected = np.exp(np.average(np.log([one, other]), weights=counts))
    assert rms(missed.fit.residual, missed.target) == pytest.approx(expected)
    assert rms_error(missed.fit, missed.target) == pytest.approx(expected)
