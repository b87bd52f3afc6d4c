"""A grasp of which something is given can always be grasped, and what is given is kept."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from forcegrasp.config import RenderConfig, validate
from forcegrasp.errors import ConfigError
from forcegrasp.evaluate.one_grasp import draw_one_grasp

GIVEN = [
    {},
    {"kappa": 1.0},
    {"b2": -20.0},
    {"radius_m": 0.0385},
    {"offset_m": 0.0164},
    {"offset_m": -0.0164},
    {"goal_force_n": 1.2},
    {"radius_m": 0.015, "offset_m": 0.0029},
    {"kappa": 0.0, "b2": -6.0, "radius_m": 0.02, "offset_m": -0.005, "goal_force_n": 0.5},
]


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("given", GIVEN, ids=str)
def test_what_is_given_is_kept_and_the_rest_fits(given, seed):
    config = RenderConfig(seed=seed, **given)
    validate(config)
    grasp = draw_one_grasp(config)
    assert len(grasp) == 1
    for name, value in given.items():
        assert getattr(grasp, name)[0] == pytest.approx(value)
    radius, away, goal = grasp.radius_m[0], abs(grasp.offset_m[0]), grasp.goal_force_n[0]
    assert away + radius < 0.045  # paper, eq. 1
    assert radius - 0.012 > away  # paper, eq. 2
    assert goal <= 0.95 * 0.30 * (0.5 + 4.5 * (1 - grasp.kappa[0])) + 1e-12


def test_the_seed_draws_what_is_not_given():
    one, same, other = (draw_one_grasp(RenderConfig(seed=seed, kappa=0.5)) for seed in (0, 0, 1))
    np.testing.assert_array_equal(one.as_array(), same.as_array())
    assert (one.as_array() != other.as_array()).sum() == 4


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"radius_m": 0.035, "offset_m": 0.02}, "offset_m=0.02: .*radius_m=0.035 .* ± 0.0100 m"),
        ({"radius_m": 0.013, "offset_m": -0.002}, "± 0.0010 m"),
        ({"offset_m": 0.03}, "± 0.0165 m"),
        ({"goal_force_n": 3.0}, "goal_force_n=3: the gripper reaches 1.42 N at softness kappa=0"),
        ({"goal_force_n": 0.5, "kappa": 1.0}, "reaches 0.142 N at softness kappa=1"),
    ],
)
def test_what_can_not_be_grasped_is_refused(given, told):
    with pytest.raises(ConfigError, match=told):
        draw_one_grasp(dataclasses.replace(RenderConfig(), **given))
