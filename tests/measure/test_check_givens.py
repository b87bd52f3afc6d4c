"""A clock that is not the gripper's, zeros that change within a set, and channels in different units are warned of."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from measured_rig import make_grasp, make_set

from forcegrasp.measure import MeasurementSet
from forcegrasp.measure.check_givens import check_givens, clock_factor, find_odd_zeros, find_tare

PERIOD_S = 0.04


@pytest.fixture(scope="module")
def sound() -> MeasurementSet:
    return make_set([make_grasp(i) for i in range(6)])


def changed(measured: MeasurementSet, change) -> MeasurementSet:
    """The set with each grasp changed by a function of its index and itself."""
    return dataclasses.replace(measured, grasps=tuple(change(i, g) for i, g in enumerate(measured.grasps)))


def pressed(measured: MeasurementSet, change) -> MeasurementSet:
    """The set with forces changed by a function of the grasp's index and the forces, ``(T, 2)``."""
    return changed(measured, lambda i, g: dataclasses.replace(g, force_n=change(i, g.force_n.copy())))


def test_a_sound_set_is_not_doubted(sound):
    assert check_givens(sound, PERIOD_S) == []


@pytest.mark.parametrize(("factor", "told"), [(2.0, "2 times too long"), (0.5, "2 times too short"), (10, "10 times")])
def test_another_clock(sound, factor, told):
    slow = changed(sound, lambda _, g: dataclasses.replace(g, time_s=g.time_s * factor))
    assert clock_factor(slow, PERIOD_S) == pytest.approx(factor)
    (warning,) = check_givens(slow, PERIOD_S)
    assert "column t_s" in warning
    assert told in warning


def test_a_clock_that_is_a_little_off_is_told_where_less_is_allowed(sound):
    slow = changed(sound, lambda _, g: dataclasses.replace(g, time_s=g.time_s * 1.05))
    assert check_givens(slow, PERIOD_S) == []
    assert clock_factor(slow, PERIOD_S, 1.006) == pytest.approx(1.05)
    assert clock_factor(sound, PERIOD_S, 1.006) is None


def test_jitter_is_no_other_clock(sound):
    late = np.random.default_rng(0).uniform(0, 0.3 * PERIOD_S, len(sound.grasps[0].time_s))
    assert clock_factor(changed(sound, lambda _, g: dataclasses.replace(g, time_s=g.time_s + late)), PERIOD_S) is None


def test_a_log_may_have_more_rows_than_there_were_commands():
    def often(grasp):
        held = (np.arange(len(grasp.time_s)) // 4) * 4
        return dataclasses.replace(grasp, command_m=grasp.command_m[held])

    assert clock_factor(make_set([often(make_grasp(i, rate=100.0)) for i in range(6)]), PERIOD_S) is None


def test_commands_that_hardly_change_say_nothing_of_a_clock(sound):
    still = changed(sound, lambda _, g: dataclasses.replace(g, time_s=2 * g.time_s, command_m=np.round(g.command_m, 2)))
    assert clock_factor(still, PERIOD_S) is None


def test_a_zero_that_changes_for_good(sound):
    tare = find_tare(pressed(sound, lambda i, f: f + np.array([-0.3 * (i >= 4), 0.0])))
    assert tare is not None
    assert tare.first == 4
    assert tare.change_n == pytest.approx([-0.3, 0.0], abs=0.02)
    (warning,) = check_givens(pressed(sound, lambda i, f: f - 0.3 * (i >= 4)), PERIOD_S)
    assert "grasp 'g4': from here on forces are shifted (f_l_n by -0.3" in warning


EXACT_N = 6.4e-3  #: how exactly the zeros of these grasps are known
SCATTER_N = EXACT_N * np.array([-5, 3, 4, -4, 6, 0])


@pytest.mark.parametrize(("shift", "told"), [(-0.3, 1), (0.3, 0)])
def test_a_single_grasp_that_starts_from_another_zero(sound, shift, told):
    """Where it reads more, fingers may press from the start on: a diagnosis tries it, and nobody is warned."""
    spoilt = pressed(sound, lambda i, f: f + np.array([shift * (i == 5), 0.0]))
    (odd,) = find_odd_zeros(spoilt)
    assert (odd.first, odd.end) == (5, 6)
    assert odd.change_n == pytest.approx([shift, 0.0], abs=0.02)
    warnings = check_givens(spoilt, PERIOD_S)
    assert len(warnings) == told
    assert all("grasp 'g5': forces are shifted in this grasp alone (f_l_n by -0.3" in one for one in warnings)


@pytest.mark.parametrize(
    "drift",
    [
        lambda i, f: f,
        lambda i, f: f + 0.3 * (i % 2),  # zeros wander
        lambda i, f: f - 0.3 * (i in (1, 5)),  # a quarter of eight
        lambda i, f: f - 0.005 * (i == 5),  # less than noise
        lambda i, f: f + SCATTER_N[i] - 20 * EXACT_N * (i == 5),  # they scatter by as much
    ],
)
def test_zeros_of_which_no_few_are_odd(sound, drift):
    assert find_odd_zeros(pressed(sound, drift)) == []


def test_a_small_change_of_zero_amid_noise_and_grasps_that_start_pressed(sound):
    def readings(index, force):
        force = force + rng.normal(0, 0.013, force.shape)
        return force + (0.5 if index in (2, 9) else 0.1 * (index >= 6))

    rng = np.random.default_rng(4)
    tare = find_tare(pressed(make_set([make_grasp(i) for i in range(14)]), readings))
    assert tare is not None
    assert tare.first == 6
    assert tare.change_n == pytest.approx([0.1, 0.1], abs=0.02)


@pytest.mark.parametrize(
    "drift",
    [
        lambda i, f: f + 0.05 * i,  # a little more in each grasp
        lambda i, f: f + 0.3 * (i % 2),  # it comes and goes
        lambda i, f: f + 0.3,  # biased, as all others
        lambda i, f: f + 0.3 * (i == 5),  # a single grasp
        lambda i, f: f + 0.01 * (i >= 3),  # less than noise
    ],
)
def test_a_zero_that_drifts_is_none_that_was_set(sound, drift):
    assert find_tare(pressed(sound, drift)) is None
