"""A fit's parameters as one vector: which there are, and that they say the same as the model they stand for."""

from __future__ import annotations

import numpy as np
import pytest

from forcegrasp.effects import catalogue, get_effect
from forcegrasp.effects.setting import EffectSetting
from forcegrasp.identify.problem import Problem
from forcegrasp.measure import MeasuredGrasp
from forcegrasp.physics.gripper_file import load_gripper

TIAGO = load_gripper("tiago")


def grasp(name: str, thing: str, radius: float | None = 0.02, offset: float | None = 0.0) -> MeasuredGrasp:
    pair = np.zeros((3, 2))
    return MeasuredGrasp(name, thing, "", radius, offset, None, np.arange(3.0), pair, pair, pair, None)


GRASPS = [
    grasp("a", "cup", 0.02, 0.001),
    grasp("b", "ball", None, None),
    grasp("c", "cup", None, 0.002),
    grasp("d", "ball", 0.03, None),
]
EFFECTS = [
    EffectSetting.typical(get_effect(name), variant)
    for name, variant in (("rate_limit", ""), ("backlash", "loose"), ("force_bias", ""))
]


@pytest.fixture
def problem() -> Problem:
    return Problem(TIAGO, GRASPS, EFFECTS)


def test_entries_are_what_is_not_given(problem):
    members = {e.name: np.flatnonzero(e.members).tolist() for e in problem.entries}
    assert members == {
        "position_gain": [0, 1, 2, 3],
        "velocity_gain": [0, 1, 2, 3],
        "rho_m of cup": [0, 2],
        "rho_m of ball": [1, 3],
        "force_scale of cup": [0, 2],
        "force_scale of ball": [1, 3],
        "radius_m of cup": [2],
        "radius_m of ball": [1],
        "offset_m of grasp b": [1],
        "offset_m of grasp d": [3],
        "rate_limit.rate_m_s": [0, 1, 2, 3],
        "backlash.gap_m": [0, 1, 2, 3],
        "force_bias.left_n": [0, 1, 2, 3],
        "force_bias.right_n": [0, 1, 2, 3],
    }
    assert len(problem) == 14
    everything_given = Problem(TIAGO, [grasp("a", "cup"), grasp("b", "cup")])
    assert [e.name for e in everything_given.entries] == [
        "position_gain", "velocity_gain", "rho_m of cup", "force_scale of cup",
    ]  # fmt: skip


def test_coordinates_round_trip(problem):
    rng = np.random.default_rng(0)
    for e in problem.entries:
        for value in (e.low, e.high, e.start, *rng.uniform(e.low, e.high, 5)):
            assert e.value(e.coordinate(value)) == pytest.approx(value, rel=1e-12, abs=1e-15)
        outside = e.high + 1.0, e.low - 1.0
        assert [e.value(e.coordinate(v)) for v in outside] == pytest.approx([e.high, e.low])
        assert e.value(1e6) == pytest.approx(e.high)
        assert e.value(-1e6) == pytest.approx(e.low)
    assert np.all(problem.low < problem.high)
    vector = problem.low + rng.uniform(size=len(problem)) * (problem.high - problem.low)
    again = [e.coordinate(v) for e, v in zip(problem.entries, problem.values(vector), strict=True)]
    assert again == pytest.approx(vector)


def test_logarithms_of_what_spans_decades(problem):
    scales = {e.name: e.logarithmic for e in problem.entries}
    assert scales["rho_m of cup"]
    assert scales["force_scale of cup"]
    assert not scales["velocity_gain"]
    assert not scales["offset_m of grasp b"]
    e = problem.entries[list(scales).index("force_scale of cup")]
    assert e.coordinate(2.0) - e.coordinate(1.0) == pytest.approx(np.log(2))


def test_the_start_is_nominal_and_typical(problem):
    values = dict(zip((e.name for e in problem.entries), problem.values(problem.start()), strict=True))
    for name, p in TIAGO.parameters.items():
        assert all(value == pytest.approx(p.nominal) for key, value in values.items() if key.split(" of ")[0] == name)
    for effect in (one.effect for one in EFFECTS):
        for p in effect.parameters:
            assert values[f"{effect.name}.{p.name}"] == pytest.approx(p.typical)


def test_a_vector_is_a_model(problem):
    named = {e.name: e for e in problem.entries}
    wanted = {
        "position_gain": 80.0, "velocity_gain": -7.0, "rho_m of cup": 0.004, "rho_m of ball": 0.009,
        "force_scale of cup": 1.5, "force_scale of ball": 3.0, "radius_m of cup": 0.021, "radius_m of ball": 0.031,
        "offset_m of grasp b": -0.003, "offset_m of grasp d": 0.004, "rate_limit.rate_m_s": 0.05,
        "backlash.gap_m": 0.001, "force_bias.left_n": 0.1, "force_bias.right_n": -0.2,
    }  # fmt: skip
    case = problem.case(np.array([named[name].coordinate(value) for name, value in wanted.items()]))
    expected = {
        "position_gain": [80] * 4,
        "velocity_gain": [-7] * 4,
        "rho_m": [0.004, 0.009, 0.004, 0.009],
        "force_scale": [1.5, 3, 1.5, 3],
        "radius_m": [0.02, 0.031, 0.021, 0.03],
        "offset_m": [0.001, -0.003, 0.002, 0.004],
        "readout_skew_s": [0] * 4,
        "force_skew_s": [0] * 4,
    }
    assert {*case.base} == {*expected}
    for name, values in expected.items():
        assert case.base[name] == pytest.approx(values), name
    assert [a.kind for a in case.effects] == [e.kind for e in EFFECTS]
    assert [a.values.tolist() for a in case.effects] == [pytest.approx(v) for v in ([0.05], [0.001], [0.1, -0.2])]


@pytest.mark.parametrize("effects", [[], EFFECTS, [EffectSetting.typical(e) for e in catalogue().values()]])
def test_columns_can_be_varied_together(effects):
    """Each entry in one group, and no grasp follows two entries of a group: its change is the one entry's."""
    problem = Problem(TIAGO, GRASPS, effects)
    groups = problem.columns()
    assert sorted(index for group in groups for index in group) == list(range(len(problem)))
    for group in groups:
        followers = np.sum([problem.entries[i].members for i in group], axis=0)
        assert followers.max() == 1
    of_base = [g for g in groups if problem.entries[g[0]].effect is None]
    assert len(of_base) == len(TIAGO.parameters)  # not one per object or grasp
