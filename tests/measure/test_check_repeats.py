"""Readings that a log repeats where none arrived are told; those of sensors that round or rest are not."""

from __future__ import annotations

import numpy as np
import pytest
from measured_rig import OPEN_M, change, make_set, standard_grasps

from forcegrasp.measure import check_set
from forcegrasp.measure.check_repeats import check_repeats

RNG = np.random.default_rng(3)


def noisy(grasps):
    return [
        change(
            g,
            position_m=g.position_m + 2.7e-5 * RNG.standard_normal(g.position_m.shape),
            force_n=g.force_n + 0.013 * RNG.standard_normal(g.force_n.shape),
        )
        for g in grasps
    ]


def held(grasps, share=0.05):
    """The left force reads what it did before, now and then."""
    out = []
    for g in grasps:
        force = g.force_n.copy()
        for row in np.flatnonzero(RNG.random(len(force)) < share):
            force[row : row + 2, 0] = force[max(row - 1, 0), 0]
        out.append(change(g, force_n=force))
    return out


def rounded(grasps):
    return [change(g, force_n=np.round(g.force_n, 2), position_m=np.round(g.position_m, 5)) for g in grasps]


def at_rest(grasps):
    """A dead zone reads nothing in free air."""
    return [change(g, force_n=np.where(g.force_n < 0.05, 0.0, g.force_n)) for g in grasps]


def told(grasps) -> list[str]:
    return [line for line in check_set(make_set(grasps), OPEN_M) if "once more, to the last bit" in line]


def test_held_readings_are_told_with_place_and_share():
    (line,) = told(held(noisy(standard_grasps())))
    assert "column f_l_n" in line
    assert "grasp 'g0'" in line
    assert "% of all rows" in line


@pytest.mark.parametrize("change_grasps", [list, rounded, at_rest])
def test_what_rounds_rests_or_is_as_it_should_be_is_not_told(change_grasps):
    assert told(change_grasps(noisy(standard_grasps()))) == []


@pytest.mark.parametrize(("share", "lines"), [(0.0, 0), (0.05, 1)])
def test_readings_that_agree_by_chance_are_not_told_and_held_ones_are_beside_them(share, lines):
    """Where positions creep over a grid that is finer than the noise some are the one before, and never come back."""
    creeping = []
    for number, g in enumerate(standard_grasps()):
        ramp = 2e-5 * np.arange(len(g.force_n))[:, None] + 0.0066 * number
        noise = 3e-5 * RNG.standard_normal(g.position_m.shape)
        force = g.force_n + 0.013 * RNG.standard_normal(g.force_n.shape)
        creeping.append(change(g, position_m=np.round(ramp + noise, 5), force_n=force))
    assert len(check_repeats(make_set(held(creeping, share)))) == lines


def test_an_encoders_steps_as_large_as_its_noise_are_not_told():
    """Between two values that come once each a slow motion seldom stays on one: 0.7 % of all rows of a rig."""
    steps = []
    for number, g in enumerate(standard_grasps()):
        ramp = np.interp(np.linspace(0, 1, len(g.force_n)), [0, 0.5, 1], [0, 0.005, 0.005])[:, None] + 0.0112 * number
        position = 2e-5 * np.round((ramp + 3e-5 * RNG.standard_normal(g.position_m.shape)) / 2e-5)
        steps.append(change(g, position_m=position, force_n=g.force_n + 0.013 * RNG.standard_normal(g.force_n.shape)))
    assert check_repeats(make_set(steps)) == []


def test_a_simulation_without_noise_is_not_told():
    assert told(standard_grasps()) == []


def test_fine_steps_of_an_encoder_agree_by_chance_as_often_as_they_nearly_do():
    """Of five decimals beside thirty times the noise one in a hundred is the one before, few the last but one."""
    moving = []
    for number, g in enumerate(standard_grasps()):
        rows = len(g.force_n)
        still = np.cumsum(np.arange(rows) % 2 * 2e-3)[:, None]  # stands for a row, moves in the next
        position = np.round(still + 0.2 * number + 3e-4 * RNG.standard_normal(g.position_m.shape), 5)
        moving.append(change(g, position_m=position, force_n=g.force_n + 0.013 * RNG.standard_normal(g.force_n.shape)))
    assert check_repeats(make_set(moving)) == []
