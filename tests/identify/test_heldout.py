"""Errors of held-out grasps against refits that really leave them out."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

from forcegrasp.identify import cross_validation
from forcegrasp.identify.cross_validation import (
    FOLDS,
    heldout_residual,
    log_likelihood,
    make_folds,
    normal_equations,
    rms,
    rms_of_grasps,
    step_of,
)
from forcegrasp.identify.fit import Fit
from forcegrasp.identify.priors import Priors
from forcegrasp.identify.target import Target
from tests.identify.targets import G, S, grasp, make


class _Counted(SimpleNamespace):
    def __len__(self) -> int:
        return self.count


def linear_fit(target: Target, jacobian: np.ndarray, measured: np.ndarray) -> Fit:
    """The least squares fit of ``measured = jacobian @ θ``, all in units of the noise."""
    jacobian = np.where(target.mask[..., None, None], jacobian, 0)
    p = jacobian.shape[-1]
    theta = np.linalg.lstsq(jacobian.reshape(-1, p), np.where(target.mask[..., None], measured, 0).ravel(), rcond=None)[
        0
    ]
    predicted = jacobian @ theta
    residual = np.where(target.mask[..., None], measured - predicted, 0)
    problem = _Counted(
        count=p,
        low=np.full(p, -np.inf),
        high=np.full(p, np.inf),
        priors=Priors.none(p),
        concerned=np.ones((len(measured), p), bool),
    )
    return Fit(problem, theta, predicted, residual, jacobian, 0 * predicted, 0.0, 1, target.weight)


def refit_without(fold: np.ndarray, jacobian: np.ndarray, measured: np.ndarray) -> np.ndarray:
    """Residuals of a fold's grasps after a fit of all the others, from the beginning."""
    rest = np.setdiff1d(np.arange(len(measured)), fold)
    p = jacobian.shape[-1]
    theta = np.linalg.lstsq(jacobian[rest].reshape(-1, p), measured[rest].ravel(), rcond=None)[0]
    return measured[fold] - jacobian[fold] @ theta


@pytest.mark.parametrize("p", [1, 5])
@pytest.mark.parametrize("lengths", [None, (150, 40, 90, 150, 12, 150, 77, 150)])
def test_heldout_residuals_of_a_linear_model_are_exact(p, lengths):
    rng, target = np.random.default_rng(p), make(lengths=lengths)
    jacobian = 100 * (1 + rng.standard_normal((G, S, 4, p)))  # with a mean, which offsets of whole grasps lean on
    measured = jacobian @ rng.standard_normal(p) + rng.standard_normal((G, S, 4)) + rng.standard_normal((G, 1, 1))
    fit = linear_fit(target, jacobian, measured)
    folds = make_folds(target.grasps)
    held = heldout_residual(fit, target, folds)
    data = np.where(target.mask[..., None], measured, 0)
    for fold in folds:
        expected = refit_without(fold, fit.jacobian, data)
        assert held[fold] == pytest.approx(expected, abs=1e-4)
        assert np.abs(held[fold] - fit.residual[fold]).max() > 1e-3  # it does make a difference
    assert np.sum(held**2) > np.sum(fit.residual**2)


def test_a_parameter_of_the_heldout_grasp_alone_stays_where_it_is():
    """Nothing else fixes its offset: it is neither lost nor made up."""
    rng, target = np.random.default_rng(0), make()
    jacobian = 100 * rng.standard_normal((G, S, 4, 3))
    jacobian[1:, ..., 2] = 0
    fit = linear_fit(target, jacobian, rng.standard_normal((G, S, 4)))
    held = heldout_residual(fit, target, [np.array([0])])
    without = fit.jacobian[..., :2]
    step = np.linalg.lstsq(without[1:].reshape(-1, 2), fit.residual[1:].ravel(), rcond=None)[0]
    assert held[0] == pytest.approx(fit.residual[0] - without[0] @ step, abs=1e-4)


@pytest.mark.parametrize("said", [0.0, 1e3])
def test_what_no_other_grasp_tells_is_fitted_to_the_heldout_one_beside_the_others_step(said, monkeypatch):
    """Such as where its object was, with what was said of it: where it is anyway makes no other grasp's step wrong."""
    monkeypatch.setattr(cross_validation, "_simulate", lambda *_: None)
    rng, target = np.random.default_rng(0), make()
    jacobian = 100 * (1 + rng.standard_normal((G, S, 4, 3)))  # with a mean: the first two move the third
    jacobian[1:, ..., 2] = 0
    jacobian[0, ..., :2] *= 30  # and without it nothing else would be where it is
    fit = linear_fit(target, jacobian, rng.standard_normal((G, S, 4)) + rng.standard_normal((G, 1, 1)))
    fit.problem.concerned[1:, 2] = False
    fit.problem.priors = Priors(fit.vector.copy(), np.array([0.0, 0.0, said]))
    held = heldout_residual(fit, target, [np.array([0])])
    shared, own = jacobian[..., :2], jacobian[0, ..., 2].ravel()
    step = np.linalg.lstsq(shared[1:].reshape(-1, 2), fit.residual[1:].ravel(), rcond=None)[0]
    left = (fit.residual[0] - shared[0] @ step).ravel()
    size = own @ left / (own @ own + said**2)
    assert held[0].ravel() == pytest.approx(left - own * size, abs=1e-4 * np.abs(left).max())
    assert np.abs(own * size).max() > 1


def test_a_fit_that_ended_short_is_no_better_on_heldout_grasps_than_where_it_ended():
    """All grasps ask for the same step then, and no fold's is told from it."""
    rng, target = np.random.default_rng(0), make()
    jacobian = 100 * rng.standard_normal((G, S, 4, 3))
    fit = linear_fit(target, jacobian, rng.standard_normal((G, S, 4)))
    short = dataclasses.replace(fit, residual=fit.residual + jacobian @ [0.002, -0.001, 0.003])
    folds = make_folds(target.grasps)
    off = heldout_residual(short, target, folds) - short.residual
    assert off == pytest.approx(heldout_residual(fit, target, folds) - fit.residual, abs=1e-3)


def test_slopes_that_promise_something_far_away_where_no_step_held_it_lead_no_fold_there(monkeypatch):
    monkeypatch.setattr(cross_validation, "_simulate", lambda *_: None)
    rng, target = np.random.default_rng(0), make()
    jacobian = 100 * rng.standard_normal((G, S, 4, 2)) * rng.uniform(0.5, 2, (G, 1, 1, 1))
    short = linear_fit(target, jacobian, 300 * rng.standard_normal((G, S, 4)))
    asked = 2.0 * jacobian @ rng.standard_normal((2, 1)) * np.where(np.arange(G) == 3, 3.0, 1.0)[:, None, None, None]
    short = dataclasses.replace(short, residual=short.residual + asked[..., 0])
    held = heldout_residual(short, target, make_folds(target.grasps))
    assert rms(held, target) == pytest.approx(rms(short.residual, target), rel=0.05)
    monkeypatch.setattr(cross_validation, "_DAMPINGS", (0.0,))
    undamped = heldout_residual(dataclasses.replace(short), target, make_folds(target.grasps))
    assert np.abs(undamped - short.residual).max() > 3 * np.abs(held - short.residual).max()


def test_a_straight_step_that_leaves_far_more_than_the_fit_is_simulated(monkeypatch):
    """A parameter that one grasp shows well and the others hardly goes anywhere without it."""
    rng, target, asked = np.random.default_rng(0), make(), []
    monkeypatch.setattr(cross_validation, "_simulate", lambda fit, target, doubtful, held: asked.extend(doubtful))
    jacobian = rng.standard_normal((G, S, 4, 2))
    jacobian[0] *= 1000
    far_off = 20 * rng.standard_normal((G, S, 4))  # so far that steps are taken as they are
    fit = linear_fit(target, jacobian, far_off)
    heldout_residual(fit, target, [np.array([k]) for k in range(G)])
    assert [fold.tolist() for fold, _ in asked] == [[0]]


@pytest.mark.parametrize(
    ("others", "own", "asked", "taken"),
    [
        ((90, 80, 0, 0), (3, 2, 0, 0), 1, 3),  # it holds
        ((110, 95, 0, 0), (3, 2, 0, 0), 2, 2),  # the others leave more
        ((90, 80, 85, 0), (9, 5, 3, 0), 3, 5),  # the fold leaves far more, and the others less by a shorter one
        ((90, 92, 0, 0), (9, 5, 0, 0), 2, 9),
        ((110, 110, 110, 110), (9, 5, 3, 2), 4, 1),
    ],
)
def test_the_step_that_does_most_for_the_others_is_simulated(monkeypatch, others, own, asked, taken):
    """Squares that the others and a fold leave by steps of four lengths, of 100 and 1 where the fit ended."""
    seen = []

    def predict(replay, cases):
        seen.append(cases)
        size = np.where(np.arange(G) == 2, np.sqrt(own[len(seen) - 1]), np.sqrt(others[len(seen) - 1] / (G - 1)))
        return np.broadcast_to(size[:, None, None], (1, G, 1, 1))

    monkeypatch.setattr(cross_validation, "predict", predict)
    monkeypatch.setattr(cross_validation, "Replay", lambda *_: None)
    monkeypatch.setattr(cross_validation, "cheap_tier", lambda *_: None)
    problem = SimpleNamespace(gripper=None, grasps=None, case=float)
    residual = np.where(np.arange(G) == 2, 1.0, np.sqrt(100 / (G - 1)))[:, None, None]
    fit = SimpleNamespace(problem=problem, vector=0.0, correction=0.0, weight=np.ones((G, 1, 1)), residual=residual)
    held = np.full((G, 1, 1), np.nan)
    target = SimpleNamespace(residual=lambda signals: signals)
    cross_validation._simulate(fit, target, [(np.array([2]), 8.0)], held)
    assert [case for cases in seen for case in cases] == [8.0, 4.0, 2.0, 0.8][:asked]
    assert held[2, 0, 0] ** 2 == pytest.approx(taken)
    assert np.isnan(np.delete(held, 2)).all()


def test_a_step_ends_at_the_bounds():
    rng, target = np.random.default_rng(0), make()
    jacobian = 100 * rng.standard_normal((G, S, 4, 2))
    fit = linear_fit(target, jacobian, rng.standard_normal((G, S, 4)))
    inner, slope = (one[1:].sum(axis=0) for one in normal_equations(fit))
    free = step_of(fit, inner, slope)
    assert np.abs(free).min() > 0
    fit.problem.low[0] = fit.problem.high[0] = fit.vector[0]
    assert step_of(fit, inner, slope) == pytest.approx([0.0, free[1]])


def test_grasps_of_no_fold_are_left_out():
    rng, target = np.random.default_rng(0), make()
    fit = linear_fit(target, rng.standard_normal((G, S, 4, 2)), rng.standard_normal((G, S, 4)))
    held = heldout_residual(fit, target, [np.array([2, 5])])
    assert np.isnan(held[[0, 1, 3, 4, 6, 7]]).all()
    assert rms(held, target) == pytest.approx(np.sqrt(np.mean(held[[2, 5]] ** 2)))
    assert np.isnan(heldout_residual(fit, target, [np.arange(G)])).all()
    assert np.isnan(rms(heldout_residual(fit, target, [np.arange(G)]), target))


@pytest.mark.parametrize("count", [2, 6, 8, 25])
def test_folds_are_whole_grasps_of_all_objects(count):
    grasps = [grasp(i) for i in range(count)]
    folds = make_folds(grasps)
    assert len(folds) == min(FOLDS, count)
    assert sorted(np.concatenate(folds).tolist()) == list(range(count))
    assert max(map(len, folds)) - min(map(len, folds)) <= 1
    if count == 25:
        for fold in folds:
            assert {grasps[i].object for i in fold} == {"cup", "ball"}


def test_marked_grasps_are_the_only_fold():
    grasps = [grasp(i, "check" if i in (1, 4) else "fit") for i in range(6)]
    assert [f.tolist() for f in make_folds(grasps)] == [[1, 4]]


def test_log_likelihood_is_gaussian_with_linear_tails():
    residual = np.zeros((2, 3, 4))
    residual[0, 0] = [1.0, -2.0, 6.0, 0.0]
    residual[1, 1] = [10.0, -100.0, np.nan, 0.0]
    # beyond 6 σ it goes on along the tangent: ½ 6² + 6 (x − 6)
    assert log_likelihood(residual) == pytest.approx([-(0.5 + 2 + 18), -(18 + 6 * 4 + 18 + 6 * 94)])


def test_error_of_each_grasp_is_over_its_own_readings():
    target = make(3, (S, 50, 10))
    residual = np.where(target.mask[..., None], np.array([1.0, 2.0, 5.0])[:, None, None], 0.0) * np.ones((3, S, 4))
    assert rms_of_grasps(residual, target) == pytest.approx([1.0, 2.0, 5.0])
