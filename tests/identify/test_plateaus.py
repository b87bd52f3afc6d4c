"""Between two jumps of a threshold nothing changes: its interval reaches to where something does."""

from __future__ import annotations

import numpy as np
import pytest

from forcegrasp.effects import get_effect
from forcegrasp.effects.setting import EffectSetting
from forcegrasp.identify.fit import fit_exactly, fit_once
from forcegrasp.identify.intervals import intervals, standard_errors, warnings
from forcegrasp.identify.plateaus import plateaus
from forcegrasp.identify.predict import predict
from forcegrasp.identify.problem import Problem
from forcegrasp.identify.simulators import Simulators
from forcegrasp.identify.target import make_target
from tests.light_set import light_set

TRUE_M = 0.0008


@pytest.fixture(scope="module")
def fitted():
    """Grasps by a driver that drops small commands, and a fit that starts, and stays, at its threshold."""
    loaded = light_set(f"command_deadband held threshold_m={TRUE_M}")
    target = make_target(loaded.measured, loaded.gripper)
    setting = EffectSetting(get_effect("command_deadband"), "held", np.array([TRUE_M]))
    problem = Problem(loaded.gripper, target.grasps, [setting])
    free = np.array([entry.effect is None for entry in problem.entries])
    return target, fit_once(target, problem, Simulators(problem), problem.start(), free=free)


def test_the_interval_of_a_threshold_reaches_to_the_next_command_that_it_drops(fitted):
    target, fit = fitted
    index = fit.problem.first_entry(0)
    _, low, high = intervals(fit, standard_errors(fit, target))[index]
    half = plateaus(fit, target)[index]
    assert low < TRUE_M < high
    assert fit.problem.entries[index].value(fit.vector[index] + half) <= high * (1 + 1e-9)
    replay = Simulators(fit.problem).cheap
    at = [fit.vector + shift * np.eye(len(fit.vector))[index] for shift in (-half, half)]
    ends = [target.residual(predict(replay, [fit.problem.case(one)])[0] + fit.correction) for one in at]
    assert min(np.sum(one**2) for one in ends) > fit.cost + 4  # it surely changes something, on either side


def test_of_what_changes_smoothly_slopes_tell(fitted):
    target, fit = fitted
    assert np.flatnonzero(plateaus(fit, target)).tolist() == [fit.problem.first_entry(0)]
    assert plateaus(fit, target) is plateaus(fit, target)  # simulated once


def test_a_fit_leaves_the_size_where_it_is_for_no_slope_tells(fitted):
    target, fit = fitted
    index, problem = fit.problem.first_entry(0), fit.problem
    again = fit_exactly(target, problem, Simulators(problem), fit.vector)
    assert again.vector[index] == fit.vector[index]
    assert not again.jacobian[..., index].any()
    assert [entry.name for entry in problem.entries if entry.jumps] == ["command_deadband.threshold_m"]
    assert not again.covariance()[index].any()
    assert not any("command_deadband" in line for line in warnings(again, standard_errors(again, target)))
