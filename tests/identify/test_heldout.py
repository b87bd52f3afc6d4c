"""Errors of held-out grasps against refits that really leave them out, and what of residuals is more than a floor."""

from __future__ import annotations

import dataclasses
import re
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import norm

from forcegrasp.effects import get_effect
from forcegrasp.effects.setting import EffectSetting
from forcegrasp.identify.cross_validation import FOLDS, heldout_residual, log_likelihood, make_folds, rms, rms_of_grasps
from forcegrasp.identify.fit import Fit
from forcegrasp.identify.intervals import intervals, reached_bound, standard_errors, warnings
from forcegrasp.identify.noise_floor import cells, excess, numerical_floor
from forcegrasp.identify.phases import PHASES
from forcegrasp.identify.problem import Problem
from forcegrasp.identify.target import Target
from forcegrasp.measure import MeasuredGrasp
from forcegrasp.physics.gripper_file import load_gripper

G, S = 8, 150
TIAGO = load_gripper("tiago")
ONES = np.ones(4)


def grasp(index: int, split: str | None = None, thing: str | None = None) -> MeasuredGrasp:
    pair = np.zeros((S, 2))
    thing = thing or ("cup", "ball")[index % 2]
    return MeasuredGrasp(f"g{index}", thing, "", 0.02, 0.0, split, np.arange(S) * 0.04, pair, pair, pair, None)


def make(count: int = G, lengths: tuple[int, ...] | None = None) -> Target:
    """A target whose grasps pass through all phases; noise 1 in every signal."""
    mask = np.arange(S) < np.array(lengths or [S] * count)[:, None]
    phase = np.where(mask, np.arange(S) * len(PHASES) // S, -1)
    grasps = tuple(grasp(i) for i in range(count))
    return Target(
        grasps, np.zeros((count, S, 4)), mask, ONES, ONES, 0 * ONES, True, phase, TIAGO, np.ones((count, 1, 1))
    )


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
    return Fit(_Counted(count=p), theta, predicted, residual, jacobian, 0 * predicted, 0.0, 1, target.weight)


def refit_without(fold: np.ndarray, jacobian: np.ndarray, measured: np.ndarray) -> np.ndarray:
    """Residuals of a fold's grasps after a fit of all the others, from the beginning."""
    rest = np.setdiff1d(np.arange(len(measured)), fold)
    p = jacobian.shape[-1]
    theta = np.linalg.lstsq(jacobian[rest].reshape(-1, p), measured[rest].ravel(), rcond=None)[0]
    return measured[fold] - jacobian[fold] @ theta


# --- held-out grasps -----------------------------------------------------------------------------------------------


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


# --- the floor -----------------------------------------------------------------------------------------------------


def noise(seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal((G, S, 4))


NOTHING = (np.zeros((G, S, 4)),) * 2


def test_cells_are_signals_and_phases():
    target = make()
    found = dict(cells(target))
    assert len(found) == 2 * len(PHASES)
    total = np.sum(list(found.values()), axis=0)
    assert np.all(total == 1)
    assert found["forces, hold"][..., 2:].any()
    assert not found["forces, hold"][..., :2].any()
    assert found["positions, first contact"].sum() == 2 * (target.phase == 1).sum()
    few = make(1, (33,))  # three of the second phase
    assert {name for name, _ in cells(few)} == set()


@pytest.mark.parametrize("seed", range(6))
def test_noise_alone_is_no_excess(seed):
    assert excess(noise(seed), NOTHING, make()) == ""


def test_excess_in_all():
    assert "in all" in excess(1.06 * noise(), NOTHING, make())


def test_few_readings_may_be_off_by_chance():
    """Four standard errors of the rms, 1 / √(2 N): 0.08 of 1,200 readings, 0.05 of 3,600."""
    many = np.full((6, S, 4), 1.06)
    assert "in all" in excess(many, (0 * many, 0 * many), make(6))
    few = many[:2]
    assert excess(few, (0 * few, 0 * few), make(2)) == ""


def test_a_rounded_reading_that_stays_says_nothing_new():
    """Of 4,800 readings 960 are new where each stays for five samples: four standard errors are 0.09, not 0.04."""
    off = np.full((G, S, 4), 1.07)
    held = dataclasses.replace(make(), signals=np.broadcast_to(np.arange(S)[:, None] // 5, (G, S, 4)) * 1.0)
    rounded = dataclasses.replace(held, quantum=ONES)
    assert rounded.is_new.sum() == G * S // 5 * 4
    assert excess(off, (0 * off, 0 * off), rounded) == ""
    assert "in all" in excess(off, (0 * off, 0 * off), held)  # not rounded: a reading that stays is one like any other
    moving = dataclasses.replace(rounded, signals=np.broadcast_to(np.arange(S)[:, None], (G, S, 4)) * 1.0)
    assert "in all" in excess(off, (0 * off, 0 * off), moving)


def test_excess_in_one_cell():
    residual = noise()
    residual[:, 60:90, 2:] *= 1.22
    assert excess(residual, NOTHING, make()).startswith("forces, both: ")


def test_excess_of_spikes():
    residual = noise()
    places = [(0, 10, 0), (2, 50, 1), (4, 80, 2), (5, 110, 3), (7, 140, 0)]
    for count, heard in ((3, False), (5, True)):
        spiky = residual.copy()
        for place in places[:count]:
            spiky[place] = 6.0
        told = excess(spiky, NOTHING, make())
        assert told == ("5 readings are more than 5 σ off" if heard else "")


def test_numerical_error_raises_the_floor():
    rng, target = np.random.default_rng(1), make()
    half, other = 0.2 * rng.standard_normal((2, G, S, 4))
    residual = noise() + 2 * half + other
    assert excess(residual, NOTHING, target) != ""
    assert excess(residual, (half, other), target) == ""
    expected = np.sqrt(1 + 4 * np.mean(half**2) + np.mean(other**2))
    assert numerical_floor((half, other), target) == pytest.approx(expected)
    where = np.zeros((G, S, 4), bool)
    where[3] = True
    expected = np.sqrt(1 + 4 * np.mean(half[3] ** 2) + np.mean(other[3] ** 2))
    assert numerical_floor((half, other), target, where) == pytest.approx(expected)


# --- intervals -----------------------------------------------------------------------------------------------------

TIAGO = load_gripper("tiago")
ENTRIES = ("position_gain", "velocity_gain", "rho_m of cup", "force_scale of cup")


def fit_at(jacobian: np.ndarray, residual: np.ndarray, *effects: str, **values: float) -> Fit:
    """A fit of one object's grasps that ended at these values, nominal or typical by default."""
    grasps = [grasp(i, thing="cup") for i in range(len(residual))]
    problem = Problem(TIAGO, grasps, [EffectSetting.typical(get_effect(name)) for name in effects])
    vector = np.array([e.coordinate(values.get(e.parameter, e.start)) for e in problem.entries])
    return Fit(problem, vector, 0 * residual, residual, jacobian, 0 * residual, 0.0, 1, np.ones((len(residual), 1, 1)))


def random_slopes(p: int, size: float = 50.0) -> np.ndarray:
    return size * np.random.default_rng(3).standard_normal((G, S, 4, p))


def test_standard_errors_of_white_noise():
    slopes = random_slopes(4)
    flat = slopes.reshape(-1, 4)
    expected = np.sqrt(np.diag(np.linalg.inv(flat.T @ flat)))
    assert standard_errors(fit_at(slopes, 0 * noise())) == pytest.approx(expected, rel=1e-6)
    white = standard_errors(fit_at(slopes, noise()))
    assert np.all(white >= expected * (1 - 1e-9))
    assert np.all(white < 3 * expected)


def test_standard_errors_see_what_is_correlated_in_a_grasp():
    """A whole grasp that is off is one mishap, not 600."""
    slopes = np.zeros((G, S, 4, 4))
    for signal in range(4):  # each parameter is the level of one signal
        slopes[..., signal, signal] = 50.0
    offset = np.random.default_rng(0).standard_normal((G, 1, 4)) + 0 * noise()
    alone, correlated = (standard_errors(fit_at(slopes, r)) for r in (noise(), offset))
    white = 1 / 50 / np.sqrt(G * S)
    assert np.all((alone >= 0.999 * white) & (alone < 2.5 * white))
    of_means = np.linalg.norm(offset[:, 0], axis=0) / 50 / G  # of the mean of G offsets
    assert np.all((correlated >= 0.999 * of_means) & (correlated <= 2.001 * of_means))
    assert np.all(correlated > 3 * alone)


@pytest.mark.parametrize("memory", [0.0, 0.7, 0.9])
def test_intervals_hold_the_truth_under_noise_with_a_memory(memory):
    """Of 95 % intervals about 95 % do: of a slow and a late response, of one in one grasp, of a fast one in two."""
    rng, grasps, time = np.random.default_rng(1), np.arange(12)[:, None, None], np.arange(100)[None, :, None] / 100
    slopes = np.zeros((12, 100, 4, 4))
    slopes[..., 0] = np.sin(3 * time)
    slopes[..., 1] = (time > 0.4) * (1 - time)
    slopes[..., 2] = (grasps == 0) * np.exp(-(((time - 0.5) / 0.1) ** 2))
    slopes[..., 3] = (grasps < 2) * np.gradient(np.exp(-(((time - 0.3) / 0.02) ** 2)), axis=1)
    inside, draws = np.zeros(4), 300
    for _ in range(draws):
        noise = rng.standard_normal(slopes.shape[:3])
        for sample in range(1, 100):
            noise[:, sample] = memory * noise[:, sample - 1] + np.sqrt(1 - memory**2) * noise[:, sample]
        found = np.linalg.lstsq(slopes.reshape(-1, 4), noise.ravel(), rcond=None)[0]
        errors = standard_errors(fit_at(slopes, noise - slopes @ found))
        inside += np.abs(found) < 1.96 * errors
    assert np.all((inside / draws > 0.93) & (inside / draws < 0.99))


def test_standard_errors_see_what_numerical_error_shifts():
    slopes, shift = random_slopes(4), np.array([0.01, -0.02, 0.0, 0.03])
    plain = standard_errors(fit_at(slopes, noise()))
    moved = standard_errors(fit_at(slopes, noise()), [slopes @ shift])
    assert moved == pytest.approx(np.sqrt(plain**2 + shift**2), rel=1e-6)


def test_intervals_are_in_the_parameters_own_units_and_bounds():
    fit = fit_at(random_slopes(4), noise(), velocity_gain=-1.2, force_scale=3.0)
    found = dict(zip(ENTRIES, intervals(fit, np.array([0.05, 0.1, 0.02, 100.0])), strict=True))
    low, high = norm.ppf([0.025, 0.975])
    close = {"rel": 1e-4}
    assert found["position_gain"] == pytest.approx((100, 100 * np.exp(low * 0.05), 100 * np.exp(high * 0.05)), **close)
    assert found["velocity_gain"] == pytest.approx((-1.2, -1.2 + low * 0.1 * 9, -1.0), **close)  # its bound
    assert found["rho_m of cup"] == pytest.approx(
        (0.0065, 0.0065 * np.exp(low * 0.02), 0.0065 * np.exp(high * 0.02)), **close
    )
    assert found["force_scale of cup"] == pytest.approx((3.0, 0.05, 30.0))  # nothing fixes it


def test_warnings_are_few_where_all_is_well():
    assert warnings(fit_at(random_slopes(4), noise()), np.full(4, 0.01)) == []


@pytest.mark.parametrize(("value", "bound"), [(30.0, "30"), (300.0, "300")])
def test_warning_at_a_bound(value, bound):
    lines = warnings(fit_at(random_slopes(4), noise(), position_gain=value), np.full(4, 0.01))
    assert lines == [f"position_gain ended at its bound {bound} N/m: widen it or doubt the model"]


def test_no_warning_where_an_effect_is_simply_not_there():
    fit = fit_at(random_slopes(6), noise(), "stiffening_contact", cubic_n=0.0, extra_power=8.0)
    lines = warnings(fit, np.full(6, 0.01))
    assert lines == ["stiffening_contact.extra_power ended at its bound 8 1: widen it or doubt the model"]


def test_warning_of_a_parameter_that_nothing_fixes():
    errors = np.array([0.01, 0.01, 2.0, 0.01])
    assert warnings(fit_at(random_slopes(4), noise()), errors) == ["rho_m of cup is hardly fixed by these data"]


def test_intervals_hold_the_truth_in_95_of_100_sets():
    """A value that is off by its standard error times a normal number, 4,000 times."""
    fit, rng, inside = fit_at(random_slopes(4), noise()), np.random.default_rng(0), []
    errors, truth = np.full(4, 0.01), fit.values
    for _ in range(1000):
        missed = dataclasses.replace(fit, vector=fit.vector + errors * rng.standard_normal(4))
        inside += [low <= t <= high for t, (_, low, high) in zip(truth, intervals(missed, errors), strict=True)]
    assert np.mean(inside) == pytest.approx(0.95, abs=0.012)


def test_hardly_fixed_parameters_are_one_warning():
    errors = np.array([2.0, 2.0, 2.0, 0.01])
    (line,) = warnings(fit_at(random_slopes(4), noise()), errors)
    assert line == "position_gain, velocity_gain and rho_m of cup are hardly fixed by these data"


def test_warning_of_two_that_do_the_same():
    slopes = random_slopes(4)
    slopes[..., 3] = -2 * slopes[..., 2] + 0.3 * slopes[..., 3]
    (line,) = warnings(fit_at(slopes, noise()), np.full(4, 0.01))
    assert re.match(r"rho_m of cup and force_scale of cup are confounded \(correlation 0\.9[89]\d\)", line)


def test_error_of_each_grasp_is_over_its_own_readings():
    target = make(3, (S, 50, 10))
    residual = np.where(target.mask[..., None], np.array([1.0, 2.0, 5.0])[:, None, None], 0.0) * np.ones((3, S, 4))
    assert rms_of_grasps(residual, target) == pytest.approx([1.0, 2.0, 5.0])


def test_eleven_pairs_are_one_warning():
    """Softness and force scale of each of eleven objects, and the two gains."""
    problem = Problem(TIAGO, [grasp(i, thing=f"thing {i}") for i in range(11)])
    names = [e.name for e in problem.entries]
    slopes = 50 * np.random.default_rng(3).standard_normal((11, S, 4, len(names)))
    for one, other in [
        ("position_gain", "velocity_gain"),
        *((f"rho_m of thing {i}", f"force_scale of thing {i}") for i in range(11)),
    ]:
        first, second = names.index(one), names.index(other)
        slopes[..., second] = slopes[..., first] + 0.05 * slopes[..., second]
    residual = np.zeros((11, S, 4))
    fit = Fit(problem, problem.start(), residual, residual, slopes, residual, 0.0, 1, np.ones((11, 1, 1)))
    (line,) = warnings(fit, np.full(len(names), 0.01))
    assert line.startswith("position_gain and velocity_gain are confounded (correlation -0.99")
    assert "; rho_m and force_scale are confounded in 11 objects or grasps (correlation up to -0.99" in line
    assert line.endswith(": only together are they fixed")


def test_three_that_go_together_are_one_group():
    covariance = np.eye(4)
    covariance[:3, :3] += 99
    slopes = np.zeros((G, S, 4, 4))
    slopes[0, 0] = np.linalg.cholesky(np.linalg.inv(covariance)).T  # so that their covariance is this one
    (line,) = warnings(fit_at(slopes, noise()), np.full(4, 0.01))
    assert line == (
        "position_gain, velocity_gain and rho_m of cup are confounded (correlation 0.990): only together are they fixed"
    )


def test_what_hardly_changes_anything_is_confounded_with_nothing():
    slopes = np.zeros((G, S, 4, 4))
    slopes[0, 0] = np.diag([300.0, 300.0, 3e-6, 0.0])
    fit = fit_at(slopes, noise())
    assert np.diag(fit.covariance()) == pytest.approx([300.0**-2, 300.0**-2, 3e-6**-2, 0.0])
    assert warnings(fit, np.full(4, 0.01)) == []


@pytest.mark.parametrize(
    ("value", "bounds", "bound"),
    [
        (1.0, (1.0, 9.0, False), 1.0),
        (1.007, (1.0, 9.0, False), 1.0),
        (1.009, (1.0, 9.0, False), None),
        (8.993, (1.0, 9.0, False), 9.0),
        (5.0, (1.0, 9.0, False), None),
        (1.006, (1.0, 1000.0, True), 1.0),
        (1.008, (1.0, 1000.0, True), None),
        (0.0, (0.0, 9.0, False, 0.0), None),  # the effect is not there
        (9.0, (0.0, 9.0, False, 0.0), 9.0),
    ],
)
def test_bounds_that_were_reached(value, bounds, bound):
    assert reached_bound(value, *bounds) == bound
