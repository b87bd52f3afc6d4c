"""What measurements are lined up to: their noise, the phases of a grasp, steps of a converter, and padding."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from forcegrasp.errors import MeasurementError
from forcegrasp.identify.phases import PHASES, contacts, find_phases
from forcegrasp.identify.sensor_noise import estimate_noise
from forcegrasp.identify.signal_axis import SignalAxis
from forcegrasp.identify.target import make_target
from forcegrasp.measure import MeasuredGrasp, MeasurementSet
from forcegrasp.measure.rounding import find_step
from forcegrasp.physics.gripper_file import load_gripper

SIGMA_M, SIGMA_N = 3e-5, 0.02
TIAGO = load_gripper("tiago")
KINDS = SignalAxis(TIAGO).kinds
TIME = np.arange(150) * 0.04


def smooth_grasp(rng: np.random.Generator, samples: int = 150, std: tuple[float, float] = (SIGMA_M, SIGMA_N)):
    """Closes, holds, opens; every signal is smooth but for white noise."""
    time = TIME[:samples]
    command = np.interp(time, [0.4, 1.4, 4.0, 5.0], [0.045, 0.02, 0.02, 0.045])
    position = 0.032 + 0.012 * np.cos(2 * np.pi * time / 6)
    force = 0.3 - 0.3 * np.cos(2 * np.pi * time / 6)
    return MeasuredGrasp(
        "g", "o", "", 0.02, 0.0, None, time, np.repeat(command[:, None], 2, axis=1),
        position[:, None] + std[0] * rng.standard_normal((samples, 2)),
        force[:, None] + std[1] * rng.standard_normal((samples, 2)), None,
    )  # fmt: skip


def measured(*grasps: MeasuredGrasp, std: tuple[float | None, float | None] = (None, None)) -> MeasurementSet:
    return MeasurementSet(Path("set"), "set", "tiago", "", "", *std, grasps, "")


# --- noise ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("std", [(SIGMA_M, SIGMA_N), (2e-4, 0.005)])
def test_noise_is_told_from_motion(std):
    rng = np.random.default_rng(0)
    estimate = estimate_noise([smooth_grasp(rng, std=std) for _ in range(8)], KINDS)
    assert estimate == pytest.approx([std[0], std[0], std[1], std[1]], rel=0.08)


def test_noise_estimate_survives_jumps():
    rng = np.random.default_rng(1)
    grasps = [smooth_grasp(rng) for _ in range(8)]
    for g in grasps:
        g.force_n[rng.integers(0, 150)] += 1.0
    assert estimate_noise(grasps, KINDS)[2] == pytest.approx(
        SIGMA_N, rel=0.15
    )  # by their spread it would be four times that


@pytest.mark.parametrize(("std", "kind"), [((0.0, SIGMA_N), "positions"), ((SIGMA_M, 0.0), "forces")])
def test_noise_that_cannot_be_told_is_asked_for(std, kind):
    g = smooth_grasp(np.random.default_rng(0), std=std)
    still = dataclasses.replace(
        g, position_m=g.position_m if std[0] else 0 * g.position_m, force_n=g.force_n if std[1] else 0 * g.force_n
    )
    with pytest.raises(MeasurementError, match=rf"noise of the {kind} can't be told .*meta\.yaml"):
        estimate_noise([still], KINDS)


def test_given_noise_is_believed():
    rng = np.random.default_rng(2)
    grasps = [smooth_grasp(rng) for _ in range(4)]
    given = make_target(measured(*grasps, std=(1e-4, 0.05)), TIAGO)
    assert given.sigma.tolist() == given.sensor_sigma.tolist() == [1e-4, 1e-4, 0.05, 0.05]
    assert given.sigma_known
    half = make_target(measured(*grasps, std=(1e-4, None)), TIAGO)
    assert half.sigma[0] == 1e-4
    assert half.sigma[2] == pytest.approx(SIGMA_N, rel=0.1)
    assert not half.sigma_known


# --- phases --------------------------------------------------------------------------------------------------------


def staged(contact: tuple[slice, slice], bias: float = 0.0) -> MeasuredGrasp:
    """Closes in samples 10 to 35, holds until 75, opens until 100; each finger feels 0.5 N in its own samples."""
    command = np.interp(np.arange(150), [10, 35, 75, 100], [0.045, 0.02, 0.02, 0.045])
    force = np.full((150, 2), bias)
    for side, when in enumerate(contact):
        force[when, side] += 0.5
    pair = np.repeat(command[:, None], 2, axis=1)
    return MeasuredGrasp("g", "o", "", 0.02, 0.0, None, TIME, pair, pair, force, None)


@pytest.mark.parametrize("bias", [0.0, 0.3])
def test_phases_of_a_grasp(bias):
    """Contact is young for 0.2 s (5 samples), a command is held after 0.3 s (8 samples); a bias is no contact."""
    grasp = staged((slice(24, 90), slice(30, 86)), bias)
    assert contacts(grasp, np.full(2, 0.013), TIAGO).sum(axis=0).tolist() == [66, 56]
    phase = np.array(PHASES)[find_phases(grasp, np.full(2, 0.013), TIAGO)]
    for expected, first, last in (
        ("free", 0, 23),
        ("first_contact", 24, 34),
        ("both", 36, 42),
        ("hold", 44, 75),
        ("release", 76, 93),  # and shortly after the pads have parted
        ("free", 96, 149),
    ):
        assert set(phase[first : last + 1]) == {expected}, (expected, phase[first : last + 1])


def test_phases_without_a_second_contact_and_without_any():
    phase = np.array(PHASES)[find_phases(staged((slice(24, 76), slice(0, 0))), np.full(2, 0.013), TIAGO)]
    assert set(phase[24:76]) == {"first_contact"}
    assert set(find_phases(staged((slice(0, 0), slice(0, 0))), np.full(2, 0.013), TIAGO)) == {PHASES.index("free")}


# --- steps of a converter ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("step", [1e-4, 0.04, 1 / 3])
@pytest.mark.parametrize("offset", [0.0, 0.0137])
def test_steps_are_found(step, offset):
    rng = np.random.default_rng(0)
    signal = 20 * step * np.sin(np.linspace(0, 9, 900)) + 0.4 * step * rng.standard_normal(900)
    assert find_step(step * np.round(signal / step) + offset) == pytest.approx(step, rel=1e-6)
    sparse = step * np.round(signal / step)
    missing = ~np.isin(np.round(sparse / step), [-7, -2, 3, 4, 11])  # values that did not occur
    assert find_step(sparse[missing]) == pytest.approx(step, rel=1e-6)


def test_no_steps_where_there_are_none():
    rng = np.random.default_rng(0)
    for signal in (rng.standard_normal(900), np.zeros(900), np.repeat([0.0, 1.0], 450), np.arange(900.0), np.zeros(0)):
        assert find_step(signal) == 0
    assert find_step(np.r_[rng.standard_normal(30), np.zeros(870)]) == 0  # silent for most of the time


def test_rounding_counts_as_noise_where_it_is_coarse():
    rng = np.random.default_rng(3)
    grasps = [smooth_grasp(rng) for _ in range(4)]
    step = 0.08
    rounded = [dataclasses.replace(g, force_n=step * np.round(g.force_n / step)) for g in grasps]
    target = make_target(measured(*rounded, std=(SIGMA_M, SIGMA_N)), TIAGO)
    assert target.quantum == pytest.approx([0, 0, step, step])
    assert target.sigma[2] == pytest.approx(np.sqrt(SIGMA_N**2 + step**2 / 12))
    assert target.sensor_sigma[2] == SIGMA_N
    fine = [dataclasses.replace(g, force_n=0.001 * np.round(g.force_n / 0.001)) for g in grasps]
    assert not make_target(measured(*fine, std=(SIGMA_M, SIGMA_N)), TIAGO).quantum.any()  # hidden by the noise


# --- lining up -----------------------------------------------------------------------------------------------------


def test_padding_residuals_and_subsets():
    rng = np.random.default_rng(4)
    lengths = (100, 150, 60)
    grasps = [dataclasses.replace(smooth_grasp(rng, n), name=f"g{n}", object=f"o{n}") for n in lengths]
    target = make_target(measured(*grasps, std=(SIGMA_M, SIGMA_N)), TIAGO)
    assert target.signals.shape == (3, 150, 4)
    assert target.mask.sum(axis=1).tolist() == list(lengths)
    assert np.all(target.phase[~target.mask] == -1)
    assert target.objects == ["o100", "o150", "o60"]
    off = target.signals + np.array([SIGMA_M, -2 * SIGMA_M, 3 * SIGMA_N, 0])
    residual = target.residual(off)
    assert residual[target.mask] == pytest.approx(np.tile([-1, 2, -3, 0], (310, 1)), abs=1e-9)
    assert not residual[~target.mask].any()
    few = target.subset(np.array([2, 0]))
    assert [g.name for g in few.grasps] == ["g60", "g100"]
    assert few.signals.shape == (2, 100, 4)
    assert np.array_equal(few.signals[1], target.signals[0, :100])
    assert few.mask.sum(axis=1).tolist() == [60, 100]
    assert few.phase.shape == (2, 100)
