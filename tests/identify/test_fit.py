"""Fits of small simulated sets, whose truth is known: values, slopes, intervals, and the ways to spare simulations."""

from __future__ import annotations

import dataclasses
import io
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from rich.console import Console

from forcegrasp.diagnosis import signatures as score_module
from forcegrasp.diagnosis.result import Diagnosis
from forcegrasp.diagnosis.search import refine as refine_module
from forcegrasp.diagnosis.search.refine import refine
from forcegrasp.diagnosis.search.search import diagnose
from forcegrasp.diagnosis.signatures import Background, Score, Signatures, best_sizes, trials
from forcegrasp.diagnosis.study import Study
from forcegrasp.effects import get_effect
from forcegrasp.effects.setting import EffectSetting
from forcegrasp.identify import base_fit, cross_validation, local_slopes
from forcegrasp.identify.base_fit import BaseFit, check_gradient, fit_base, rms_error
from forcegrasp.identify.cross_validation import heldout_residual, make_folds, rms
from forcegrasp.identify.fit import Fit, fit_exactly, fit_once
from forcegrasp.identify.fitted_model import model_of
from forcegrasp.identify.givens import errors_by_givens
from forcegrasp.identify.intervals import intervals, standard_errors, warnings
from forcegrasp.identify.loading import Loaded
from forcegrasp.identify.noise_floor import beyond_fit, excess, numerical_error, numerical_floor
from forcegrasp.identify.predict import Case, predict
from forcegrasp.identify.problem import Problem
from forcegrasp.identify.simulators import Simulators
from forcegrasp.identify.target import Target, make_target
from forcegrasp.measure import MeasuredGrasp, MeasurementSet
from forcegrasp.physics.gripper_file import load_gripper
from forcegrasp.replay.replay import Replay
from forcegrasp.reports.diagnosis import lines as lines_of
from forcegrasp.reports.diagnosis import printed
from forcegrasp.reports.diagnosis_as_json import diagnosis_json
from tests.light_set import light_set

TIAGO = load_gripper("tiago")
SIGMA = np.array([2.7e-5, 2.7e-5, 0.013, 0.013])
BIAS = np.array([0.05, -0.03])
TRUTH = {
    "position_gain": 118.0,
    "velocity_gain": -7.4,
    "rho_m of cup": 0.0050,
    "rho_m of ball": 0.0081,
    "force_scale of cup": 2.6,
    "force_scale of ball": 1.4,
}
RADIUS = {"cup": 0.022, "ball": 0.026}


def planned(index: int) -> MeasuredGrasp:
    """A short grasp that starts near the object: closes, holds, reverses, opens; the rest follows from the index."""
    thing = ("cup", "ball")[index % 2]
    time = np.arange(45) * 0.04
    contact, deep = RADIUS[thing], 0.003 + 0.0005 * index
    way = [contact + 0.002, contact - deep, contact - deep, contact - deep / 3, contact - deep / 3, contact + 0.003]
    command = np.interp(time, [0.12, 0.3 + 0.04 * index, 0.9, 1.0, 1.3, 1.5], way)
    pair = np.repeat(command[:, None], 2, axis=1)
    offset = 0.0004 * (index % 3 - 1)
    return MeasuredGrasp(f"g{index}", thing, "", contact, offset, None, time, pair, pair, 0 * pair, None)


def truth_of(problem: Problem) -> np.ndarray:
    return np.array([e.coordinate(TRUTH[e.name]) for e in problem.entries if e.effect is None])


def measure(bias: np.ndarray) -> tuple[Target, Problem]:
    """Six grasps of two objects with noise, simulated by the model itself."""
    bare = [planned(i) for i in range(6)]
    problem = Problem(TIAGO, bare)
    signals = predict(Replay(TIAGO, bare), [problem.case(truth_of(problem))])[0]
    signals = signals + SIGMA * np.random.default_rng(0).standard_normal(signals.shape) + np.r_[0, 0, bias]
    full = tuple(
        dataclasses.replace(g, position_m=signals[i, :, :2], force_n=signals[i, :, 2:]) for i, g in enumerate(bare)
    )
    target = make_target(MeasurementSet(Path(), "", "tiago", "", "", SIGMA[0], SIGMA[2], full, ""), TIAGO)
    return target, Problem(TIAGO, target.grasps)


@pytest.fixture(scope="module")
def fitted() -> SimpleNamespace:
    """A fit of the base model from its nominal parameters."""
    target, problem = measure(np.zeros(2))
    simulators = Simulators(problem)
    fit = fit_once(target, problem, simulators, problem.start())
    numerical = numerical_error(fit, target)
    return SimpleNamespace(
        target=target,
        problem=problem,
        simulators=simulators,
        fit=fit,
        numerical=numerical,
        errors=standard_errors(fit, target, numerical),
    )


def exact(problem: Problem, vector: np.ndarray) -> np.ndarray:
    return predict(Replay(problem.gripper, problem.grasps), [problem.case(vector)])[0]


def distance(fit: Fit, errors: np.ndarray) -> np.ndarray:
    """How far the parameters are from the truth, in standard errors."""
    return np.abs(fit.vector - truth_of(fit.problem)) / errors


# --- fits ----------------------------------------------------------------------------------------------------------


def test_truth_is_recovered_within_its_intervals(fitted):
    fit, target = fitted.fit, fitted.target
    assert rms_error(fit, target) == pytest.approx(1.0, abs=0.03)
    assert fit.gradient < 5
    found = intervals(fit, fitted.errors)
    for e, (value, low, high) in zip(fit.problem.entries, found, strict=True):
        assert low < value < high
        assert low < TRUTH[e.name] < high
        assert high - low < 0.1 * abs(value)  # and the intervals say something
    assert warnings(fit, fitted.errors) == []


def test_what_is_predicted_is_the_model_itself(fitted):
    fit, target = fitted.fit, fitted.target
    model = exact(fit.problem, fit.vector)
    assert fit.predicted == pytest.approx(model, abs=1e-12)
    assert fit.residual == pytest.approx(
        np.where(target.mask[..., None], (target.signals - model) / SIGMA, 0), abs=1e-9
    )
    assert fit.cost == pytest.approx(np.sum(fit.residual**2))
    cheap = predict(fitted.simulators.cheap, [fit.problem.case(fit.vector)])[0]
    assert fit.correction == pytest.approx(model - cheap, abs=1e-12)


def test_fit_of_the_model_itself(fitted):
    fit = fit_exactly(fitted.target, fitted.problem, fitted.simulators, fitted.fit.vector)
    assert fit.predicted == pytest.approx(exact(fit.problem, fit.vector), abs=1e-12)
    assert fit.cost <= 1.001 * fitted.fit.cost
    assert np.abs(fit.vector - fitted.fit.vector).max() < fitted.errors.max()
    assert distance(fit, fitted.errors).max() < 2


def test_slopes(fitted):
    """Force over the logarithm of f_α is the force; the others by differences to both sides."""
    fit, problem = fitted.fit, fitted.problem
    names = [e.name for e in problem.entries]
    cheap = fit.predicted - fit.correction
    for thing in ("cup", "ball"):
        index = names.index(f"force_scale of {thing}")
        of_thing = np.array([g.object == thing for g in problem.grasps])
        slope = fit.jacobian[..., index]
        assert slope[of_thing][..., 2:] == pytest.approx(cheap[of_thing][..., 2:] / SIGMA[2], rel=0.015, abs=1e-6)
        assert not slope[of_thing][..., :2].any()
        assert not slope[~of_thing].any()
    index = names.index("position_gain")
    step = np.zeros(len(problem))
    step[index] = 0.02
    up, down = predict(fitted.simulators.cheap, [problem.case(fit.vector + s) for s in (step, -step)])
    central = ((up - down) / 0.04 / SIGMA).ravel()
    ours = fit.jacobian[..., index].ravel()
    assert np.linalg.norm(ours - central) < 0.1 * np.linalg.norm(central)


def test_slopes_follow_the_values_between_measurements(fitted, monkeypatch):
    """Broyden's update (1965): along a step the new slopes give what was seen, across it they stay."""
    fit, target = fitted.fit, fitted.target
    local = local_slopes.LocalSlopes(target, fit.problem, fitted.simulators.cheap, fitted.simulators.cheap, None, 0.02)
    start, rng = fit.vector, np.random.default_rng(0)
    before, value = local.slopes(start), local.value(start)
    step = 0.2 * rng.standard_normal(len(start))
    counts = []
    monkeypatch.setattr(
        local_slopes, "predict", lambda replay, cases: counts.append(len(cases)) or predict(replay, cases)
    )
    after = local.slopes(start + step)
    assert counts == [1]  # the values alone
    seen = np.where(target.mask[..., None], (local.value(start + step) - value) / target.sigma, 0)
    assert np.abs(seen - before @ step).max() > 0.1
    assert after @ step == pytest.approx(seen, abs=1e-9)
    across = rng.standard_normal(len(start))
    across -= step * (across @ step) / (step @ step)
    assert after @ across == pytest.approx(before @ across, abs=1e-9)


def test_what_is_not_free_stays(fitted):
    start = fitted.problem.start()
    free = np.array([e.parameter in ("force_scale", "position_gain") for e in fitted.problem.entries])
    fit = fit_once(fitted.target, fitted.problem, fitted.simulators, start, free=free)
    assert np.array_equal(fit.vector[~free], np.clip(start, fit.problem.low + 1e-9, fit.problem.high - 1e-9)[~free])
    assert np.all(fit.vector[free] != start[free])
    assert fitted.fit.cost < fit.cost
    fixed = fit_once(fitted.target, fitted.problem, fitted.simulators, fitted.fit.vector, free=np.zeros(6, bool))
    assert np.array_equal(fixed.vector, fitted.fit.vector)
    assert fixed.evaluations == 0
    assert fixed.predicted == pytest.approx(fitted.fit.predicted, abs=1e-12)


def test_known_slopes_spare_simulations_and_lead_to_the_same_place(fitted, monkeypatch):
    """A bias hides in forces; the base parameters' slopes come from the fit before."""
    target, _ = measure(BIAS)
    before = fit_once(target, fitted.problem, fitted.simulators, fitted.fit.vector)
    bias = get_effect("force_bias")
    problem = Problem(TIAGO, target.grasps, [EffectSetting.typical(bias)])
    start = np.r_[before.vector, problem.start()[len(before.vector) :] * 0.3]
    counts = []

    def counted(replay, cases):
        counts[-1] += len(cases)
        return predict(replay, cases)

    monkeypatch.setattr(local_slopes, "predict", counted)
    fits = []
    for given in ({}, {"known_slopes": before.jacobian}, {"slopes": before.jacobian}):
        counts.append(0)
        fits.append(fit_once(target, problem, fitted.simulators, start, before.correction, 0, **given))
    assert counts[1] < 0.75 * counts[0]
    assert counts[1] < counts[2] < counts[0]  # they are found anew where it ends
    assert np.array_equal(fits[1].jacobian[..., :6], before.jacobian)
    assert not np.array_equal(fits[2].jacobian[..., :6], before.jacobian)
    for fit in fits:
        assert rms_error(before, target) > 1.3
        assert rms_error(fit, target) < 1.06
        assert fit.values[-2:] == pytest.approx(BIAS, abs=0.003)
    assert np.abs(fits[0].vector - fits[1].vector)[:6] == pytest.approx(0, abs=0.02)


def test_slopes_where_a_fit_ends_are_measured_unless_only_the_place_is_asked_for(fitted, monkeypatch):
    counts, fits = [], []

    def counted(replay, cases):
        counts[-1] += len(cases)
        return predict(replay, cases)

    monkeypatch.setattr(local_slopes, "predict", counted)
    given = fitted.target, fitted.problem, fitted.simulators, fitted.fit.vector + 0.02, fitted.fit.correction, 0
    for at_the_end in (True, False):
        counts.append(0)
        fits.append(fit_once(*given, slopes=fitted.fit.jacobian, at_the_end=at_the_end))
    assert counts[1] == counts[0] - len(fitted.problem.columns())
    assert np.array_equal(fits[1].vector, fits[0].vector)
    assert fits[1].cost == fits[0].cost
    assert not np.array_equal(fits[1].jacobian, fits[0].jacobian)


def test_cases_that_differ_in_sensors_share_a_simulation(fitted, monkeypatch):
    base = fitted.problem.case(fitted.fit.vector).base
    bias, delay = get_effect("force_bias"), get_effect("command_delay")
    cases = [
        Case(base),
        Case(base, (EffectSetting(bias, "", BIAS),)),
        Case(base | {"force_scale": 2 * base["force_scale"]}),
        Case(base, (EffectSetting(delay, "", np.array([0.04])), EffectSetting(bias, "", BIAS))),
        Case(base | {"position_gain": base["position_gain"] + 1}),
    ]
    simulated = []
    simulate = Replay.simulate
    monkeypatch.setattr(Replay, "simulate", lambda self, g, *a: simulated.append(len(g)) or simulate(self, g, *a))
    replay = Replay(TIAGO, fitted.target.grasps, tier="fast")  # one that remembers nothing yet
    together = predict(replay, cases)
    assert simulated == [3 * 6]
    alone = [predict(replay, [case])[0] for case in cases]
    assert together.tobytes() == np.array(alone).tobytes()
    assert together[1] - together[0] == pytest.approx(np.broadcast_to(np.r_[0, 0, BIAS], together[0].shape), abs=1e-12)
    assert together[2][..., 2:] == pytest.approx(2 * together[0][..., 2:])


def test_what_was_just_simulated_is_not_simulated_again(fitted, monkeypatch):
    replay, base = Replay(TIAGO, fitted.target.grasps, tier="fast"), fitted.problem.case(fitted.fit.vector).base
    bias, stronger = get_effect("force_bias"), base | {"position_gain": base["position_gain"] + 1}
    simulated = []
    simulate = Replay.simulate
    monkeypatch.setattr(Replay, "simulate", lambda self, g, *a: simulated.append(len(g)) or simulate(self, g, *a))
    (once,) = predict(replay, [Case(base)])
    again, moved, read = predict(replay, [Case(base), Case(stronger), Case(base, (EffectSetting(bias, "", BIAS),))])
    assert simulated == [6, 6]
    assert again.tobytes() == once.tobytes()
    assert np.abs(moved - once).max() > 1e-5
    assert read - once == pytest.approx(np.broadcast_to(np.r_[0, 0, BIAS], once.shape), abs=1e-12)
    for gain in range(2, 22):  # until it is forgotten
        predict(replay, [Case(base | {"position_gain": base["position_gain"] + gain})])
    assert len(replay.remembered) < 20


def test_several_starts_agree(fitted):
    told = []
    base = fit_base(fitted.target, fitted.problem, fitted.simulators, np.random.default_rng(0), told.append)
    assert base.converged, base.reason
    assert base.reason == ""
    assert len(base.errors) == 3
    assert len(told) == 3  # each start
    assert np.ptp(base.errors) < 0.02
    assert distance(base.fit, fitted.errors).max() < 2


def test_a_fit_that_stopped_short_is_led_on_by_few_grasps(fitted, monkeypatch):
    starts = []

    def once(target, problem, simulators, start, **more):
        starts.append(start)
        if len(starts) == 1:  # ends where it begins
            more |= {"free": np.zeros(len(problem), bool)}
        return fit_once(target, problem, simulators, start, **more)

    monkeypatch.setattr(base_fit, "fit_once", once)
    base = fit_base(fitted.target, fitted.problem, fitted.simulators, np.random.default_rng(0))
    assert len(starts) == 2
    assert base.converged
    assert rms_error(base.fit, fitted.target) == pytest.approx(rms_error(fitted.fit, fitted.target), rel=0.01)


@pytest.fixture(scope="module")
def light() -> tuple[Target, Problem, Simulators]:
    """Grasps of a gripper that takes less time to simulate: all that many fits begin with."""
    loaded = light_set(grasps=6, samples=48)
    target = make_target(loaded.measured, loaded.gripper)
    problem = Problem(loaded.gripper, target.grasps)
    return target, problem, Simulators(problem)


def test_a_fit_that_leaves_noise_alone_needs_no_second_start(light, monkeypatch):
    monkeypatch.setattr(base_fit, "_agree", lambda ends, target: False)
    assert fit_base(*light, np.random.default_rng(0)).converged
    monkeypatch.setattr(base_fit, "_NOISE_ALONE", 0.9)
    apart = fit_base(*light, np.random.default_rng(0))
    assert not apart.converged
    assert "the starts end in different places" in apart.reason


def test_starts_that_end_apart_roughly_may_agree_at_the_end(light, monkeypatch):
    monkeypatch.setattr(base_fit, "_NOISE_ALONE", 0.9)
    agree, told = base_fit._agree, []

    def only_at_the_end(ends, target) -> bool:
        return isinstance(ends[0], Fit) and agree(ends, target)

    monkeypatch.setattr(base_fit, "_agree", only_at_the_end)
    base = fit_base(*light, np.random.default_rng(0), told.append)
    assert base.converged
    target, problem, _ = light
    assert base.fit.cost == pytest.approx(fit_once(*light, problem.start()).cost, rel=0.01)
    assert rms_error(base.fit, target) == pytest.approx(1.0, abs=0.03)
    assert "start 6 of 6" in told[-2]
    assert told[-1] == f"base model, the best 3 starts to the end: {rms_error(base.fit, target):.2f} × noise"
    monkeypatch.setattr(base_fit, "_FINISHED", 1)  # one start agrees with no other
    assert not fit_base(*light, np.random.default_rng(0)).converged


def test_a_fit_that_ended_on_a_slope_is_not_believed(fitted):
    steep = dataclasses.replace(fitted.fit, gradient=20.0)
    gate = check_gradient(steep, fitted.target)
    assert not gate.converged
    assert "slope of 20.0 standard errors" in gate.reason
    assert check_gradient(fitted.fit, fitted.target).converged


# --- one more effect -----------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def threshold(fitted) -> SimpleNamespace:
    """The base model fitted to readings with a large dead zone: a threshold, whose signatures are far from straight."""
    zone = get_effect("force_deadzone")
    model = fitted.problem.case(fitted.fit.vector)
    case = Case(model.base, (EffectSetting(zone, zone.variants[0], np.array([0.4])),))
    signals = predict(fitted.simulators.exact, [case])[0]
    target = dataclasses.replace(
        fitted.target, signals=signals + SIGMA * np.random.default_rng(3).standard_normal(signals.shape)
    )
    fit = fit_once(target, fitted.problem, fitted.simulators, fitted.fit.vector)
    told: list[str] = []
    study = Study(target, fitted.simulators, (), progress=told.append)
    return SimpleNamespace(study=study, told=told, fit=fit, zone=zone, background=Background(fit, []))


def test_refining_finds_a_large_threshold(fitted, threshold):
    study, target, fit, zone = threshold.study, threshold.study.target, threshold.fit, threshold.zone
    signatures, tried = Signatures(study), trials([zone])
    signatures.simulate(fit, tried)
    scores = [group[0] for group in signatures.scores(fit, threshold.background, tried)]
    assert {score.setting.variant for score in scores} == set(zone.variants)
    sized, on_few = zip(*best_sizes(scores, study, fit, threshold.background), strict=True)
    assert list(on_few) == pytest.approx([s.gain for s in sized])  # where no few are chosen, they are all
    assert [s.setting.kind for s in sized] == [s.setting.kind for s in scores]
    refined = refine(scores, study, fit, threshold.background)
    assert 1 <= len(refined) == sum(line.endswith("× noise") for line in threshold.told) <= len(scores)
    best = min(refined, key=lambda r: r.fit.cost)
    assert best.score.setting.variant == zone.variants[0]
    refined = fit_exactly(target, best.fit.problem, fitted.simulators, best.fit.vector)
    assert refined.values[-1] == pytest.approx(0.4, rel=0.05)
    assert rms_error(refined, target) < 1.1 < rms_error(fit, target)
    promised = max(s.gain for s in sized)
    assert promised > 0.5 * (fit.cost - refined.cost)  # what `refine` goes by when it leaves effects out


def test_what_few_grasps_promise_is_fitted_though_one_grasp_of_all_is_far_off(fitted, threshold, monkeypatch):
    """At a size that is not fitted yet a finger may stick in one grasp: a fit mends that."""
    one = next(iter(Signatures(threshold.study).missing(trials([threshold.zone]))))
    scores = [Score(one, gain, np.ones(1)) for gain in (50.0, 40.0, 30.0)]
    gains = [(-1000.0, 45.0), (100.0, np.nan), (20.0, 10.0)]
    sized = [(dataclasses.replace(s, gain=all_), few) for s, (all_, few) in zip(scores, gains, strict=True)]
    monkeypatch.setattr(refine_module, "best_sizes", lambda *_: sized)
    monkeypatch.setattr(refine_module, "fit_with", lambda *_: threshold.fit)
    refined = refine(scores, threshold.study, threshold.fit, threshold.background)
    assert [r.score.gain for r in refined] == [40.0, 50.0]


@pytest.mark.parametrize("worse", [True, False])
def test_a_rough_fit_that_ends_above_its_start_begins_anew_from_the_sizes_that_are_tried(threshold, monkeypatch, worse):
    """A spring of 3 N at 1 mm that a signature promised, where 0.1 N is right: no slope there leads back."""
    one = next(iter(Signatures(threshold.study).missing(trials([threshold.zone]))))
    score, begun = Score(one, 50.0, np.ones(1)), list[EffectSetting]()
    stuck = dataclasses.replace(threshold.fit, residual=(2.0 if worse else 0.9) * threshold.fit.residual)
    better = dataclasses.replace(threshold.fit, residual=0.5 * threshold.fit.residual)

    def from_trials(settings, *_):
        begun.extend(settings)
        return better

    monkeypatch.setattr(refine_module, "best_sizes", lambda *_: [(score, np.nan)])
    monkeypatch.setattr(refine_module, "fit_with", lambda *_: stuck)
    monkeypatch.setattr(refine_module, "roughly_as", from_trials)
    (refined,) = refine([score], threshold.study, threshold.fit, threshold.background)
    assert refined.fit is (better if worse else stuck)
    assert [s.kind for s in begun] == [one.kind] * len(begun)
    assert bool(begun) is worse


def test_signatures_are_simulated_when_asked_for_and_kept(fitted, threshold, monkeypatch):
    zone, limit = threshold.zone, get_effect("force_limit")
    signatures, of_zone, of_limit = Signatures(threshold.study), trials([zone]), trials([limit])
    assert signatures.missing([*of_zone, *of_limit]) == [*of_zone, *of_limit]
    signatures.simulate(threshold.fit, of_zone)
    assert signatures.missing([*of_zone, *of_limit]) == of_limit
    monkeypatch.setattr(score_module, "predict", lambda *a: pytest.fail("simulated again"))
    signatures.simulate(threshold.fit, [])
    one, other = (signatures.scores(f, threshold.background, of_zone)[0][0].gain for f in (threshold.fit, fitted.fit))
    assert one > 10 * other  # scored against what each fit leaves


# --- what is left --------------------------------------------------------------------------------------------------


def test_a_right_model_leaves_nothing_and_a_wrong_one_does(fitted):
    target, fit = fitted.target, fitted.fit
    folds = make_folds(target.grasps)
    held = heldout_residual(fit, target, folds)
    assert rms(held, target) == pytest.approx(1.0, abs=0.04)
    numerical = fitted.numerical
    assert all(n.shape == fit.residual.shape and n.any() for n in numerical)
    left = beyond_fit(fit, numerical)
    slopes = fit.jacobian.reshape(-1, len(fit.problem))
    for before, after in zip(numerical, left, strict=True):
        assert np.linalg.norm(after) <= np.linalg.norm(before)
        assert slopes.T @ after.ravel() == pytest.approx(0, abs=1e-6 * np.linalg.norm(slopes) * np.linalg.norm(before))
    assert 1 <= numerical_floor(left, target) < 1.1
    assert excess(held, left, target) == ""
    off = heldout_residual(
        fit_once(measure(BIAS)[0], fitted.problem, fitted.simulators, fit.vector), measure(BIAS)[0], folds
    )
    assert excess(off, left, target) != ""


def test_a_folds_simulated_step_gives_what_the_model_itself_gives(fitted, monkeypatch):
    """Though the cheap one simulates it: by how much that is off is known where the fit ended."""
    fit, target, seen = dataclasses.replace(fitted.fit), fitted.target, []

    def watched(replay: Replay, cases: list[Case]) -> np.ndarray:
        seen.extend(cases)
        assert replay.tier == "fitting"
        return predict(replay, cases)

    monkeypatch.setattr(cross_validation, "_COUNTS_NEAR", -1.0)
    monkeypatch.setattr(cross_validation, "predict", watched)
    folds = make_folds(target.grasps)
    held = heldout_residual(fit, target, folds)
    itself = target.residual(predict(fitted.simulators.exact, seen[: len(folds)]))
    expected = np.concatenate([one[fold] for one, fold in zip(itself, folds, strict=True)])
    order = np.concatenate(folds)
    same = np.abs(held[order] - fit.residual[order]).max(axis=(1, 2)) > 0  # whose step lowered the others' error
    assert same.any()
    assert rms((held[order] - expected)[same], target.subset(order[same])) < 0.05


# --- a whole diagnosis ---------------------------------------------------------------------------------------------


def diagnosed(fitted, target: Target, *names: str) -> Diagnosis:
    start = fit_once(target, fitted.problem, fitted.simulators, fitted.fit.vector)
    base, effects = BaseFit(start, (), True), [get_effect(name) for name in names]
    return diagnose(target, base, fitted.simulators, effects, np.random.default_rng(0))


def test_one_interval_everywhere(fitted):
    """In words, in JSON and in the model file, a parameter has the same value and interval."""
    target = measure(BIAS)[0]
    diagnosis = diagnosed(fitted, target, "force_bias", "force_drift")
    assert (diagnosis.verdict, diagnosis.effects) == ("effect", ("force_bias",))
    expected = numerical_error(diagnosis.fit, target)
    assert all(np.array_equal(one, other) for one, other in zip(diagnosis.numerical, expected, strict=True))
    measured = MeasurementSet(Path(), "", "tiago", "", "", SIGMA[0], SIGMA[2], target.grasps, "")
    model = model_of(diagnosis.fit, target, Loaded(measured, TIAGO, []), diagnosis.numerical)
    by_givens = tuple(errors_by_givens(diagnosis.fit, target, measured))
    diagnosis = dataclasses.replace(diagnosis, by_givens=by_givens)  # as a diagnosis of the whole set has them
    found = diagnosis_json(diagnosis, None, [], "s")
    lines, table = "\n".join(lines_of(diagnosis, None)), Console(width=200, record=True, file=io.StringIO())
    table.print(printed(diagnosis))
    shown = table.export_text()
    for name, fitted_value in model.effects[0].parameters.items():
        assert found["parameters"]["force_bias"][name] == dataclasses.asdict(fitted_value)
        assert found["ranking"][0]["parameters"][name] == fitted_value.value
        assert found["steps"][0]["ranking"][0]["parameters"][name] == fitted_value.value
        assert f"{name} {fitted_value.value:.4g} N (95 %: {fitted_value.low:.4g} to {fitted_value.high:.4g})" in lines
        assert f"{name} {fitted_value.value:.3g} N" in shown


@pytest.mark.parametrize("shape", ["normal", "heavy tails"])
def test_noise_that_is_not_as_said_is_no_missing_effect(fitted, shape):
    rng, target = np.random.default_rng(5), fitted.target
    noise = (
        3 * rng.standard_normal(target.signals.shape)
        if shape == "normal"
        else 2 * rng.standard_t(3, target.signals.shape)
    )
    clean = exact(fitted.problem, truth_of(fitted.problem))
    signals = np.where(target.mask[..., None], clean + SIGMA * noise, 0)
    diagnosis = diagnosed(fitted, dataclasses.replace(target, signals=signals), "force_bias", "force_drift")
    assert diagnosis.error_after > 1.4
    assert (diagnosis.verdict, diagnosis.effects, diagnosis.left) == ("explained", (), "")
    assert diagnosis.noise is not None
    assert diagnosis.noise.affected.all()
    assert diagnosis.noise.heavy_tails.any() == (shape == "heavy tails")
