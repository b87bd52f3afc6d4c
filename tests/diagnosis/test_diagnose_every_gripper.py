"""Grippers with one motor, hinges, one moving jaw, effort instead of a force sensor, or no forces at all."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from forcegrasp.diagnosis.advice import advise
from forcegrasp.diagnosis.diagnose_set import chosen_effects, diagnose_set
from forcegrasp.effects import get_effect
from forcegrasp.errors import ConfigError
from forcegrasp.identify.comparison import Comparison
from forcegrasp.identify.fitted_model import model_of
from forcegrasp.identify.initial_guess import guess, pad_distances
from forcegrasp.identify.loading import Loaded
from forcegrasp.identify.phases import PHASES, contacts, find_phases
from forcegrasp.identify.problem import Problem
from forcegrasp.identify.target import make_target
from forcegrasp.measure import MeasuredGrasp
from forcegrasp.physics.gripper import Gripper
from forcegrasp.physics.gripper_file import load_gripper
from forcegrasp.replay.record import parse_effect, record
from forcegrasp.reports import comparison as comparison_report
from forcegrasp.reports import diagnosis as diagnosis_report
from forcegrasp.reports import diagnosis_as_json
from forcegrasp.reports import fit as fit_report
from forcegrasp.reports.html import write_report
from tests.made_up import shortened

LOOK_ALIKES = ["backlash", "coulomb_friction", "command_delay"]
NAMES = {
    "tiago": ["position_l", "position_r", "force_l", "force_r"],
    "franka_hand": ["position", "force_l", "force_r"],
    "robotiq_2f85": ["position", "force_l", "force_r"],
    "so101_gripper": ["position", "force"],
}


def recorded(gripper: Gripper, hidden: list[str], grasps: int, monkeypatch, objects: int = 2) -> Loaded:
    """Typical noise; never written, so that its fingerprint does not matter."""
    monkeypatch.setattr("forcegrasp.replay.record.fingerprint_of_set", lambda *_: "set")
    made = record(
        gripper,
        "rich",
        grasps=grasps,
        objects=objects,
        effects=[parse_effect(name, gripper) for name in hidden],
        known={},
        off_nominal=0.1,
        position_std_m=2.7e-5 * gripper.position_scale,
        force_std_n=0.013 * gripper.force_scale,
        seed=1,
    )
    return Loaded(made.measured, gripper, [])


@pytest.mark.long
@pytest.mark.parametrize("name", ["franka_hand", "so101_gripper"])
def test_finds_what_was_hidden(name, monkeypatch, tmp_path):
    """A coupled hand with two force sensors; one jaw whose motor's effort is read. And all that is told of it."""
    loaded = recorded(load_gripper(name), ["coulomb_friction"], 8, monkeypatch, objects=1)
    loaded = dataclasses.replace(loaded, measured=shortened(loaded.measured, 60))
    diagnosis, _ = diagnose_set(loaded, None, LOOK_ALIKES, 0, lambda text: None)
    assert (diagnosis.verdict, diagnosis.effects) == ("effect", ("coulomb_friction",))
    assert diagnosis.error_after <= 1.1 * diagnosis.floor
    assert diagnosis.error_after < 0.8 * diagnosis.error_before
    (found,) = model_of(diagnosis.fit, diagnosis.target, loaded, diagnosis.numerical).effects
    assert found.values == pytest.approx(parse_effect("coulomb_friction", loaded.gripper).values, rel=0.1)

    told = diagnosis_as_json.diagnosis_json(diagnosis, None, [], "set")
    assert list(told["parameters"]["coulomb_friction"]) == [p.name for p in found.effect.parameters]
    assert diagnosis_report.lines(diagnosis, advise(diagnosis))[0].startswith("coulomb_friction: ")
    write_report(tmp_path / "report.html", "", "", diagnosis_report.sections(diagnosis, None, []), {})


@pytest.mark.parametrize("name", NAMES)
def test_signals_are_the_grippers(name, monkeypatch, tmp_path):
    gripper = load_gripper(name)
    loaded = recorded(gripper, [], 2, monkeypatch)
    target = make_target(loaded.measured, gripper)
    assert target.axis.names == NAMES[name]
    assert target.signals.shape[-1] == target.sigma.shape[0] == len(NAMES[name])
    assert target.sigma == pytest.approx(
        [
            (0.013 * gripper.force_scale) if unit == "N" else 2.7e-5 * gripper.position_scale
            for unit in target.axis.units
        ]
    )
    assert {PHASES[k] for k in np.unique(target.phase) if k >= 0} >= {"free", "hold", "release"}

    residual = np.where(target.mask[..., None], 1.0, 0.0) * np.ones(len(target.axis.names))
    comparison = Comparison(target, target.signals - residual * target.sigma, residual, residual, 1.0)
    told = comparison_report.compare_json(comparison, "set", "model", [])
    unit = gripper.unit
    assert list(told["signals"]) == NAMES[name]
    assert told["signals"][NAMES[name][0]][f"rms_{unit}"] == pytest.approx(target.sigma[0])
    words = comparison_report.noise_sentence(target)
    assert {"m": "positions 27 µm, forces 13 mN", "rad": "positions 0.432 mrad, forces 130 mN"}[unit] in words or (
        name == "franka_hand" and "positions 27 µm, forces 130 mN" in words
    )
    write_report(tmp_path / "report.html", "", "", comparison_report.sections(comparison, []), {})
    assert comparison_report.printed(comparison).row_count > 1


def test_contact_is_a_push_without_motion_where_the_motors_effort_is_read():
    """Moving takes effort as well: what the jaw feels on its way does not count, and friction at rest does not."""
    gripper = load_gripper("so101_gripper")
    time = np.arange(150) * 0.04
    position = np.interp(np.arange(150), [10, 40, 90, 120], [0.8, 0.3, 0.3, 0.8])
    moving = np.abs(np.diff(position, prepend=0.8)) > 0.005
    force = np.where(moving, 3.0, 0.5)  # damping and friction
    force[44:90] = 6.0
    force[:11] = 0
    column = position[:, None]
    grasp = MeasuredGrasp("g", "o", "", 0.02, 0.0, None, time, column, column, force[:, None], None)
    touching = contacts(grasp, np.array([4e-4, 0.1]), gripper)
    assert touching.shape == (150, 1)
    assert np.flatnonzero(touching).tolist() == list(range(44, 90))
    phase = np.array(PHASES)[find_phases(grasp, np.array([4e-4, 0.1]), gripper)]
    assert set(phase[:44]) == {"free"}
    assert set(phase[50:90]) == {"hold"}


def without_forces(gripper: Gripper) -> Gripper:
    fingers = tuple(dataclasses.replace(finger, force_sensor="") for finger in gripper.fingers)
    return dataclasses.replace(gripper, fingers=fingers, force="none")


def test_a_gripper_without_forces_is_told_by_its_motion(monkeypatch, tmp_path):
    gripper = without_forces(load_gripper("franka_hand"))
    assert gripper.forces == ()
    loaded = recorded(gripper, [], 2, monkeypatch)
    target = make_target(loaded.measured, gripper)
    assert target.axis.names == ["position"]
    assert list(target.axis.kinds) == ["position"]
    assert target.rounding is None
    assert {"free", "hold"} <= {PHASES[k] for k in np.unique(target.phase) if k >= 0}
    residual = np.where(target.mask[..., None], 1.0, 0.0)
    comparison = Comparison(target, target.signals, residual, residual, 1.0)
    assert {kind for _, kind, _ in comparison.explanations()} == {"position"}
    assert "force_n" not in comparison.covariates()
    assert comparison_report.noise_sentence(target).startswith("sensor noise: positions 27 µm, as")
    write_report(tmp_path / "report.html", "", "", comparison_report.sections(comparison, []), {})


@pytest.mark.parametrize("name", ["franka_hand", "robotiq_2f85", "so101_gripper"])
def test_objects_are_where_the_pads_meet_them(name):
    gripper = load_gripper(name)
    radius = 0.02
    position = np.array([[gripper.stroke], [float(gripper.contact_position(radius))]])
    pads = pad_distances(gripper, position)
    assert pads[0] == pytest.approx(gripper.opening.faces_m, abs=3e-3)  # hinges travel on arcs
    assert pads[1].sum() == pytest.approx(2 * radius, abs=1e-4)
    assert (pads[1, 1] < pads[1, 0]) == (name == "so101_gripper")  # its left jaw stands still


@pytest.mark.parametrize("name", ["franka_hand", "robotiq_2f85"])
def test_radii_are_felt(name, monkeypatch):
    loaded = recorded(load_gripper(name), [], 4, monkeypatch)
    grasps = tuple(dataclasses.replace(g, radius_m=None, offset_m=None) for g in loaded.measured.grasps)
    target = make_target(dataclasses.replace(loaded.measured, grasps=grasps), loaded.gripper)
    problem = Problem(loaded.gripper, grasps)
    values = dict(zip((e.name for e in problem.entries), problem.values(guess(target, problem)), strict=True))
    for g in loaded.measured.grasps:
        assert values[f"radius_m of {g.object}"] == pytest.approx(
            g.radius_m, abs=3e-3
        )  # a start for a fit: the pads sink in
        assert values[f"offset_m of grasp {g.name}"] == pytest.approx(g.offset_m, abs=4e-3)


def test_effects_are_those_of_the_gripper():
    hand, jaw = load_gripper("franka_hand"), load_gripper("so101_gripper")
    (delay,) = chosen_effects(hand, ["command_delay"])
    assert delay.motors == 1
    assert get_effect("command_delay").motors == 2
    assert len(chosen_effects(jaw, [])) < len(chosen_effects(load_gripper("tiago"), []))
    with pytest.raises(ConfigError, match="force_crosstalk: needs 2 force readings; so101_gripper has 1"):
        chosen_effects(jaw, ["force_crosstalk"])


def test_steps_of_a_turning_motor_are_a_parameter_in_radians(monkeypatch):
    gripper = load_gripper("robotiq_2f85")
    loaded = recorded(gripper, ["quantisation position_step_rad=0.004 force_step_n=0.4"], 2, monkeypatch)
    target = make_target(loaded.measured, gripper)
    assert target.rounding is not None
    assert target.rounding.parameters == pytest.approx({"position_step_rad": 0.004, "force_step_n": 0.4})
    assert "readings come in steps: positions 4 mrad, forces 400 mN" in comparison_report.noise_sentence(target)
    assert fit_report.steps_picture(target).caption.startswith("Readings of force left")
