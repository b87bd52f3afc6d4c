"""What a set gives with a tolerance is fitted as a reading is: neither as it was said, nor as if nobody had said it."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from forcegrasp.diagnosis.signatures import Background
from forcegrasp.identify.cross_validation import step_of
from forcegrasp.identify.fit import fit_once
from forcegrasp.identify.initial_guess import guess
from forcegrasp.identify.intervals import standard_errors
from forcegrasp.identify.priors import Priors, with_rows
from forcegrasp.identify.problem import Problem
from forcegrasp.identify.simulators import Simulators
from forcegrasp.identify.target import make_target
from tests.light_set import light_set

STD_M = (3e-4, 5e-4)  # of radii and places
OFF_M = 4e-4  # by how much the place of the first grasp is said wrong


@pytest.fixture(scope="module")
def truly():
    return light_set(grasps=4, samples=54)


@pytest.fixture(scope="module")
def target(truly):
    return make_target(truly.measured, truly.gripper)


def problem_of(target, *changes: dict, fitted_m=STD_M) -> Problem:
    """The base model's, with what is said of the first grasps changed."""
    said = [dataclasses.replace(grasp, fitted_m=fitted_m) for grasp in target.grasps]
    for place, change in enumerate(changes):
        said[place] = dataclasses.replace(said[place], **change)
    return Problem(target.gripper, said)


def fit_of(target, problem: Problem):
    return fit_once(target, problem, Simulators(problem), problem.start())


def test_radii_and_places_have_one_where_they_are_given_and_to_be_fitted(target):
    problem = problem_of(target, {"offset_m": None}, {"fitted_m": (3e-4, 0.0)})
    stds = {entry.name: entry.std for entry in problem.entries if entry.parameter in ("radius_m", "offset_m")}
    names = [grasp.name for grasp in target.grasps]
    assert (
        stds
        == {
            **{f"radius_m of {name}": 3e-4 for name in target.objects},
            f"offset_m of grasp {names[0]}": np.inf,  # which nobody said
            **{f"offset_m of grasp {name}": 5e-4 for name in names[2:]},
        }
    )
    starts = {entry.name: entry.start for entry in problem.entries}
    assert starts[f"offset_m of grasp {names[2]}"] == target.grasps[2].offset_m
    assert len(problem.priors) == len(stds) - 1


def test_without_a_tolerance_there_are_none(target):
    assert not len(problem_of(target, fitted_m=(0.0, 0.0)).priors)


def test_a_fit_begins_where_they_are_said_to_be_and_not_where_they_were_felt(target):
    problem = problem_of(target)
    given = problem.priors.precision > 0
    assert guess(target, problem)[given] == pytest.approx(problem.start()[given], abs=1e-12)


def test_readings_say_where_an_object_was_and_the_rest_is_left_to_what_was_said(target):
    true = target.grasps[0].offset_m
    problem = problem_of(target, {"offset_m": true + OFF_M})
    fit = fit_of(target, problem)
    (place,) = (i for i, e in enumerate(problem.entries) if e.name == f"offset_m of grasp {target.grasps[0].name}")
    error = problem.entries[place].scale * float(standard_errors(fit, target)[place])
    assert error < 0.5 * STD_M[1]
    assert fit.values[place] == pytest.approx(true, abs=3 * error)
    assert fit.cost == pytest.approx(np.sum(fit.residual**2) + problem.priors.cost(fit.vector))
    as_said = fit_of(target, problem_of(target, {"offset_m": true + OFF_M}, fitted_m=(0.0, 0.0)))
    assert fit.cost < as_said.cost - 10


def test_a_parameter_that_no_reading_tells_stays_where_it_is_said_to_be(target):
    """With its own uncertainty; and a fold's step does not take it elsewhere."""
    problem = problem_of(target)
    fit = fit_of(target, problem)
    index = int(np.flatnonzero(problem.priors.precision)[0])
    jacobian = fit.jacobian.copy()
    jacobian[..., index] = 0
    blind = dataclasses.replace(fit, jacobian=jacobian, vector=problem.start())
    std = 1 / problem.priors.precision[index]
    assert np.sqrt(blind.covariance()[index, index]) == pytest.approx(std)
    off = dataclasses.replace(blind, vector=blind.vector + std * (np.arange(len(problem)) == index))
    inner, slope = np.zeros((len(problem),) * 2), np.zeros(len(problem))
    inner[index, index] = 1e-9
    assert step_of(off, inner, slope)[index] == pytest.approx(-std * std**-2 / (std**-2 + 1), rel=1e-6)  # of a ridge


def test_what_an_effect_is_credited_with_is_what_its_fit_gains():
    """Of a straight model: a parameter with a prior takes but a part of a signature that is like its own."""
    rng, precision = np.random.default_rng(0), 3.0
    slope, signature = rng.standard_normal((2, 200))
    signature += 2 * slope
    residual = 4 * signature + rng.standard_normal(200)

    def left(columns: np.ndarray) -> float:
        rows = with_rows(columns, 201)
        rows[200, 0] = precision
        both = np.r_[residual, 0.0]
        return float(np.sum((both - rows @ np.linalg.lstsq(rows, both, rcond=None)[0]) ** 2))

    gain = left(slope[:, None]) - left(np.column_stack([slope, signature]))
    priors = Priors(np.zeros(1), np.array([precision]))
    background = Background.__new__(Background)
    background._basis = np.linalg.qr(priors.below(slope[:, None]))[0]
    clean = background.remove(signature)
    optimum = background.remove(np.r_[residual, 0.0])
    assert (clean @ optimum) ** 2 / (clean @ clean) == pytest.approx(gain)
