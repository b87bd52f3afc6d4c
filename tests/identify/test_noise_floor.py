"""What of residuals is more than the noise and the numerical error: the floor."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

from forcegrasp.identify.comparison import _not_fitted
from forcegrasp.identify.noise_floor import cells, excess, numerical_floor
from forcegrasp.identify.phases import PHASES
from tests.identify.targets import ONES, G, S, make, noise

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


def test_what_is_unsure_of_the_start_raises_the_floor():
    target, off = make(), np.zeros((4, G, S, 4))
    for index, size in enumerate((0.1, 0.2, 0.3, 1.5)):
        off[index] = size
    assert numerical_floor(off, target) == pytest.approx(np.sqrt(1 + 4 * 0.1**2 + 0.2**2 + 0.3**2 + 1.5**2))
    residual = np.zeros((G, S, 4))
    residual[:, ::30, 0] = 7.0
    assert excess(residual, off[:2], target).startswith("40 readings are more than")
    assert excess(residual, off, target) == ""


@pytest.mark.parametrize(("error", "told"), [(1.0, "the fit came to no clear end"), (1.6, "is not fitted: it falls")])
def test_a_fit_without_an_end_is_told_by_what_it_leaves(error, told):
    comparison = SimpleNamespace(floor=1.02, floor_ratio=lambda: error)
    note = _not_fitted(comparison, "it falls")  # pyright: ignore[reportArgumentType]
    assert told in note
    assert "it falls" in note
    assert ("diagnose" in note) == (error > 1.5)


@pytest.mark.parametrize(("readings", "told"), [(3, ""), (4, "in all")])
def test_a_few_readings_that_are_far_off_are_no_excess_however_far(readings, told):
    """A touch that is over within a row, missed: 37 σ in one reading of twelve thousand."""
    residual = noise()
    residual[:readings, 10, 3] = 37.0
    assert told in excess(residual, NOTHING, make())
    assert bool(excess(residual, NOTHING, make())) == bool(told)
