"""Grasps are drawn as the paper says: within its constraints, and uniformly."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from scipy import stats

from forcegrasp.config import GraspConfig
from forcegrasp.errors import ConfigError
from forcegrasp.physics import FixedGrasps, GraspSampler, default_gripper

N = 100_000


@pytest.fixture(scope="module")
def grasps(draw):
    return draw(N, seed=7)


def test_object_fits_between_the_open_fingers(grasps):
    assert (np.abs(grasps.offset_m) + grasps.radius_m < 0.045).all()  # eq. 1


def test_both_fingers_reach_the_object(grasps):
    assert (grasps.radius_m - 0.012 > np.abs(grasps.offset_m)).all()  # eq. 2
    assert (grasps.radius_m > 0.012).all()  # eq. 3


@pytest.mark.parametrize("offset_m", [[0.04, 0.045], [-0.045, -0.04]])
def test_constraints_are_strict_at_their_limit(draw, offset_m):
    grasps = draw(2000, offset_m=offset_m)
    open_m, deformation = Fraction(0.045), Fraction(0.012)
    for radius, offset in zip(map(Fraction, grasps.radius_m), map(Fraction, np.abs(grasps.offset_m)), strict=True):
        assert offset + radius < open_m
        assert radius - deformation > offset
    assert (np.sign(grasps.offset_m) == np.sign(offset_m[0])).all()


def test_the_whole_of_the_allowed_offsets_is_used(grasps):
    limit = np.minimum(0.045 - grasps.radius_m, grasps.radius_m - 0.012)
    assert stats.kstest(grasps.offset_m / limit, stats.uniform(-1, 2).cdf).pvalue > 1e-3


def test_goal_can_be_reached(grasps):
    highest = 0.95 * 0.30 * default_gripper().training.force_scale(grasps.kappa)
    assert (grasps.goal_force_n >= 0.08).all()
    assert (grasps.goal_force_n <= highest).all()
    share = (grasps.goal_force_n - 0.08) / (highest - 0.08)
    assert stats.kstest(share, stats.uniform.cdf).pvalue > 1e-3


def test_goal_of_a_soft_object_is_the_largest_it_reaches(draw):
    # 0.2 N · 0.30 N · 0.5 is below the smallest goal force
    grasps = draw(100, kappa=[1.0, 1.0], goal_force_max=0.2)
    np.testing.assert_allclose(grasps.goal_force_n, 0.2 * 0.30 * 0.5)


@pytest.mark.parametrize(("name", "low", "high"), [("kappa", 0, 1), ("b2", -13, -6), ("radius_m", 0.015, 0.035)])
def test_uniform(grasps, name, low, high):
    values = getattr(grasps, name)
    assert low <= values.min() < values.max() <= high
    assert stats.kstest(values, stats.uniform(low, high - low).cdf).pvalue > 1e-3


def test_parameters_are_drawn_independently(grasps):
    drawn = np.stack([grasps.kappa, grasps.b2, grasps.radius_m])
    off_diagonal = np.corrcoef(drawn)[~np.eye(3, dtype=bool)]
    assert np.abs(off_diagonal).max() < 5 / np.sqrt(N)


def test_seed_determines_the_grasps(draw):
    np.testing.assert_array_equal(draw(50, seed=3).as_array(), draw(50, seed=3).as_array())
    assert (draw(50, seed=3).as_array() != draw(50, seed=4).as_array()).any(axis=0).all()


def test_given_ranges_are_honoured(draw):
    ranges = {"kappa": [0.2, 0.3], "b2": [-8, -7], "radius_m": [0.02, 0.021], "offset_m": [-0.001, 0.004]}
    grasps = draw(2000, **ranges)
    for name, (low, high) in ranges.items():
        values = getattr(grasps, name)
        assert low <= values.min() < low + 0.1 * (high - low)
        assert high - 0.1 * (high - low) < values.max() <= high


def test_set_ranges_replaces_the_object_ranges_only():
    config = GraspConfig(kappa=[0.2, 0.3])
    sampler = GraspSampler(config)
    sampler.set_ranges([0.020, 0.025], [0.0, 0.0])
    grasps = sampler(np.random.default_rng(0), np.arange(2000))
    assert 0.020 <= grasps.radius_m.min() < 0.0205 < 0.0245 < grasps.radius_m.max() <= 0.025
    assert (grasps.offset_m == 0).all()
    assert 0.2 <= grasps.kappa.min() < grasps.kappa.max() <= 0.3
    assert config == GraspConfig(kappa=[0.2, 0.3])  # the caller's config is not ours to change


@pytest.mark.parametrize("deformation_m", [0.015, 0.02])
def test_objects_that_could_be_squeezed_flat_are_refused(deformation_m):
    with pytest.raises(ConfigError, match=r"radius_m=\[0\.015.* must exceed grasp\.deformation_m=0\.0"):
        GraspSampler(GraspConfig(deformation_m=deformation_m))


def test_set_ranges_refuses_objects_that_could_be_squeezed_flat():
    sampler = GraspSampler(GraspConfig(radius_m=[0.025, 0.035], deformation_m=0.022))
    with pytest.raises(ConfigError, match="deformation"):
        sampler.set_ranges([0.020, 0.025], [-0.04, 0.04])


def test_fixed_grasps_belong_to_their_slot(draw):
    grasps = draw(6)
    ids = np.array([4, 0, 3])
    drawn = FixedGrasps(grasps)(np.random.default_rng(0), ids)
    np.testing.assert_array_equal(drawn.as_array(), grasps.as_array()[ids])
