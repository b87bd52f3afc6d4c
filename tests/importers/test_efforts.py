"""Voltages as commands, and efforts that are sizes of a current: a motor's constants are found from them."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from forcegrasp.errors import MeasurementError
from forcegrasp.identify.comparison import compare
from forcegrasp.identify.fit import fit_once
from forcegrasp.identify.loading import Loaded
from forcegrasp.identify.problem import Problem
from forcegrasp.identify.simulators import Simulators
from forcegrasp.identify.target import make_target
from forcegrasp.importers.recording import Recording
from forcegrasp.importers.servo_set import as_set
from forcegrasp.measure import check_servo
from forcegrasp.physics import load_gripper
from forcegrasp.reports.comparison import sections
from forcegrasp.reports.html import Picture

VOLTS = load_gripper(str(Path(__file__).parents[1] / "mechanisms" / "volts.yaml"))
#: Of the motor that is recorded: k/R, k²/R, inertia of rotor and wheel, amperes of a newton metre.
GAIN, BACK_EMF, INERTIA, SCALE = 0.3, 0.08, 0.01 + 0.1 * 0.05**2 / 2, 4.0
TIME = np.arange(0, 4, 0.01)
VOLTAGE = 2 * np.sign(np.sin(2 * TIME)) * np.abs(np.sin(5 * TIME))


def recorded() -> Recording:
    """J dv/dt = k/R u − k²/R v, exact over each step of a held voltage."""
    position, velocity, torque = (np.zeros(len(TIME)) for _ in range(3))
    rate, period = BACK_EMF / INERTIA, 0.01
    for index, volts in enumerate(VOLTAGE[:-1]):
        end = GAIN * volts / BACK_EMF
        fade = np.exp(-rate * period)
        velocity[index + 1] = end + (velocity[index] - end) * fade
        position[index + 1] = position[index] + end * period + (velocity[index] - end) * (1 - fade) / rate
        torque[index + 1] = GAIN * volts - BACK_EMF * velocity[index + 1]
    noise = np.random.default_rng(0).standard_normal((2, len(TIME)))
    current = np.abs(SCALE * torque) + 1e-3 * noise[1]
    return Recording(
        "run", ("shaft",), TIME, VOLTAGE[:, None], (position + 1e-4 * noise[0])[:, None],
        command_unit="V", effort=current[:, None], effort_unit="A", effort_signed=False,
    )  # fmt: skip


def test_a_motors_constants_are_found_from_voltage_and_the_size_of_its_current():
    measured = as_set([recorded()], VOLTS, "", "")
    assert measured.columns.signals == ("t_s", "udes_v", "q_rad", "tau_nm")
    assert check_servo(measured, [3.0], unsigned=True) == []
    signed = dataclasses.replace(recorded(), effort=-measured.grasps[0].force_n, effort_signed=True)
    np.testing.assert_array_equal(as_set([signed], VOLTS, "", "").grasps[0].force_n, np.abs(measured.grasps[0].force_n))
    target = make_target(measured, VOLTS)
    problem = Problem(VOLTS, target.grasps)
    fit = fit_once(target, problem, Simulators(problem), problem.start())
    found = dict(zip((entry.name for entry in problem.entries), fit.values, strict=True))
    assert found["torque_per_volt"] == pytest.approx(GAIN, rel=0.03)
    assert found["back_emf"] == pytest.approx(BACK_EMF, rel=0.03)
    assert found["effort_scale"] == pytest.approx(SCALE, rel=0.03)


def test_a_report_shows_efforts_in_newton_metres():
    found, _, _ = compare(Loaded(as_set([recorded()], VOLTS, "", ""), VOLTS, []), None, 0, lambda text: None)
    assert found.target.axis.units == ["rad", "N·m"]
    pictures = [block for part in sections(found, []) for block in part.blocks if isinstance(block, Picture)]
    labels = {axes.get_ylabel() for one in pictures for axes in one.figure.axes}
    assert any("N·m" in label for label in labels)


def test_a_command_or_an_effort_that_the_mechanism_does_not_take_is_told():
    run = recorded()
    with pytest.raises(MeasurementError, match="run: commands are in V; so101_jaw takes rad: choose another mechanism"):
        as_set([run], load_gripper("so101_jaw"), "", "")
    with pytest.raises(MeasurementError, match=r"commands are in N; dfki_pendulum takes N·m"):
        as_set([dataclasses.replace(run, command_unit="N")], load_gripper("dfki_pendulum"), "", "")
    signed = dataclasses.replace(VOLTS, unsigned=False)
    with pytest.raises(MeasurementError, match=r"its efforts are without a sign.*`effort: unsigned` or `none`"):
        as_set([run], signed, "", "")
    without = dataclasses.replace(VOLTS, parameters={k: p for k, p in VOLTS.parameters.items() if k != "effort_scale"})
    with pytest.raises(MeasurementError, match=r"its efforts are in A; volts reads N·m: .* the parameter effort_scale"):
        as_set([run], without, "", "")
