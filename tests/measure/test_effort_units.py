"""Efforts of a motor in another unit, or turned round, in some grasps."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from forcegrasp.measure import MeasuredGrasp, MeasurementSet
from forcegrasp.measure.effort_units import find_odd_effort
from forcegrasp.measure.force_units import OddUnit, check_force_units, find_odd_unit
from forcegrasp.measure.schema import Columns, fingerprint_of_set

COLUMNS = Columns(("qdes_rad",), ("q_rad",), ("f_n",))
GAIN, STEPS = 20.0, 160


def grasp(number: int, gain: float = GAIN, ramps: bool = False, meets: float = 0.4) -> MeasuredGrasp:
    """A servo goes to 0.1 rad, is kept from it by an object, and opens; with ``ramps`` no faster than 0.5 rad/s."""
    rng, time = np.random.default_rng(number), 0.02 * np.arange(STEPS)
    command = np.where((time > 0.3) & (time < 2.5), 0.1, 0.8)
    ends = np.concatenate([command[:1], command[:-1]])
    meant = ends
    if ramps:
        meant = 0.8 - 0.5 * (np.clip(time - 0.3, 0, 1.4) - np.clip(time - 2.5, 0, 1.4))
    position = np.maximum(meant, meets)
    effort = gain * (position - meant + 0.005 * rng.standard_normal(STEPS))
    read = position + 4e-4 * rng.standard_normal(STEPS)
    signals = (command[:, None], read[:, None], effort[:, None])
    return MeasuredGrasp(f"g{number:02d}", "box", "", None, None, None, time, *signals, None, columns=COLUMNS)


def made(grasps: list[MeasuredGrasp]) -> MeasurementSet:
    facts = {"gripper": "one", "position_std_m": 4e-4, "force_std_n": 0.1, "grasps": tuple(grasps)}
    return MeasurementSet(
        path=Path("rig"), name="rig", source="", license="", **facts, fingerprint=fingerprint_of_set(**facts)
    )


@pytest.mark.parametrize(("factor", "told"), [(-1.0, -1.0), (96.7, 96.7), (1e-3, 1e-3), (-1000.0, -1000.0)])
def test_grasps_of_another_unit_or_sign(factor, told):
    measured = made([grasp(i, GAIN * (factor if i in (2, 5) else 1.0)) for i in range(8)])
    found = find_odd_unit(measured)
    assert found is not None
    assert (found.channel, found.grasps) == (0, (2, 5))
    assert found.factor == pytest.approx(told, rel=0.02)
    (warning,) = check_force_units(measured)
    assert "column f_n: reads about" in warning
    assert "g02 and g05" in warning or "g02, g05" in warning
    assert "in newtons there, and f ≥ 0 where it presses" in warning
    right = found.put_right(measured.grasps[2]).force_n
    np.testing.assert_allclose(right * found.factor, measured.grasps[2].force_n)


def test_a_sign_alone_changes_no_unit():
    measured = made([grasp(i, -1.03 * GAIN if i == 4 else GAIN) for i in range(6)])
    assert find_odd_unit(measured) == OddUnit(0, -1.0, (4,))


@pytest.mark.parametrize(
    "grasps",
    [
        [grasp(i) for i in range(6)],
        [grasp(i, GAIN * (2.5 if i == 1 else 1.0)) for i in range(6)],  # a gain is no unit
        [grasp(i, GAIN * (-1.0 if i % 2 else 1.0)) for i in range(6)],  # nothing tells which are right
        [grasp(i, GAIN * 4.0**i) for i in range(6)],  # this is no servo's effort
        [grasp(i, meets=0.0) for i in range(6)],  # nothing was met
    ],
)
def test_what_is_neither(grasps):
    assert find_odd_effort(made(grasps)) is None


def test_a_motor_that_is_under_way_does_not_press():
    """One that goes no faster than so much is far from its command meanwhile, without effort."""
    assert find_odd_effort(made([grasp(i, ramps=True, meets=0.4 if i < 5 else 0.15) for i in range(8)])) is None


def test_no_rows_are_no_odd_ones():
    short = dataclasses.replace(grasp(0), **{
        name: getattr(grasp(0), name)[:3] for name in ("time_s", "command_m", "position_m", "force_n")
    })  # fmt: skip
    assert find_odd_effort(made([short])) is None
