"""What one recording of a servo has otherwise than the set says, or the clock of all: told, and put right."""

from __future__ import annotations

import dataclasses
import re
from importlib import import_module
from pathlib import Path

import mujoco
import numpy as np
import pytest

from forcegrasp.diagnosis.diagnose_set import diagnose_set
from forcegrasp.diagnosis.faults.suspects import suspects
from forcegrasp.identify.cross_validation import rms
from forcegrasp.identify.fit import Fit, fit_exactly
from forcegrasp.identify.loading import Loaded
from forcegrasp.identify.problem import Problem
from forcegrasp.identify.progress import silent
from forcegrasp.identify.simulators import Simulators
from forcegrasp.identify.target import Target, make_target
from forcegrasp.identify.verdict import Verdict
from forcegrasp.identify.weights import reweigh
from forcegrasp.measure.schema import Columns, MeasuredGrasp, MeasurementSet
from forcegrasp.physics.gripper_file import load_gripper

SCENE = """<mujoco><option timestep="0.002" integrator="implicitfast"/>
<worldbody><body name="arm"><joint name="shoulder" type="hinge" axis="0 1 0" damping="0.05" armature="0.01"/>
<inertial pos="0 0 -0.2" mass="0.6" diaginertia="1e-4 1e-4 1e-4"/></body></worldbody>
<actuator><position name="drive" joint="shoulder" kp="14" kv="1.1"/></actuator></mujoco>"""
DESCRIPTION = """format: forcegrasp-mechanism/1
name: arm
model: arm.xml
motors: [{joint: shoulder, actuator: drive, span: 1.5}]
command: position
effort: motor
period_s: 0.01
settings: {payload_kg: [body_mass]}
parameters:
  position_gain: {nominal: 14, low: 5, high: 40, unit: N·m/rad, scope: gripper,
    writes: [actuator_gainprm 0, -actuator_biasprm 1]}
  damping: {nominal: 0.05, low: 0.005, high: 0.5, unit: N·m·s/rad, scope: gripper, writes: [dof_damping]}
  effort_scale: {nominal: 1.0, low: 0.5, high: 2, unit: "1", scope: gripper, writes: []}
"""
PERIOD_S, SAMPLES, STD = 0.01, 250, (8e-4, 0.02)
PAYLOADS = {"waves": 0.6, "steps": 0.3, "ramps": 0.9, "release": 0.5}


def commands(name: str) -> np.ndarray:
    time = PERIOD_S * np.arange(SAMPLES)
    return {
        "waves": 0.6 * np.sin(4 * time) + 0.2 * np.sin(9 * time),
        "steps": 0.5 * np.sign(np.sin(5 * time)),
        "ramps": np.abs((0.8 * time) % 1.6 - 0.8),
        "release": np.where(time < 0.5, 0.9, -0.4),
    }[name]


def record(folder: Path, limit: float = np.inf, friction: float = 0.0) -> Loaded[MeasurementSet]:
    """An arm that swings a payload, its motor switched off for a while in the last recording, by MuJoCo alone.

    Args:
      folder: where its description is written.
      limit: of the motor's torque, N·m.
      friction: of the joint, dry, N·m.
    """
    (folder / "arm.xml").write_text(SCENE)
    (folder / "arm.yaml").write_text(DESCRIPTION)
    arm, rng, recordings = load_gripper(str(folder / "arm.yaml")), np.random.default_rng(0), []
    columns, time = Columns(("qdes_rad",), ("q_rad",), ("tau_nm",)), PERIOD_S * np.arange(SAMPLES)
    for name, payload in PAYLOADS.items():
        model = mujoco.MjModel.from_xml_string(SCENE)
        model.body_mass[1], model.dof_frictionloss[0] = payload, friction
        model.actuator_forcelimited[0], model.actuator_forcerange[0] = np.isfinite(limit), (-limit, limit)
        data, command, read = mujoco.MjData(model), commands(name), []
        enabled = np.where((time > 0.8) & (time < 1.3) & (name == "release"), 0.0, 1.0)
        for desired, on in zip(command, enabled, strict=True):
            read.append((data.qpos[0], data.actuator_force[0]))  # the torque of the step before
            model.actuator_gainprm[0, 0], model.actuator_biasprm[0, 1:3] = 13 * on, (-13 * on, -1.1 * on)
            data.ctrl[0] = desired
            mujoco.mj_step(model, data, round(PERIOD_S / model.opt.timestep))
        position, effort = np.split(np.array(read) + STD * rng.standard_normal((SAMPLES, 2)), 2, axis=1)
        recording = MeasuredGrasp(name, "", name, None, None, None, time, command[:, None], position, effort, None)
        settings = {"payload_kg": payload}
        recordings.append(dataclasses.replace(recording, columns=columns, settings=settings, enabled=enabled))
    measured = MeasurementSet(folder, "arm", str(arm.path), "", "", STD[0], STD[1], tuple(recordings), "")
    return Loaded(measured, arm, [])


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Loaded[MeasurementSet]:
    return record(tmp_path_factory.mktemp("arm"))


def changed(loaded: Loaded[MeasurementSet], name: str, **change) -> Loaded[MeasurementSet]:
    """The set with a recording written otherwise; all of them without a name."""

    def written(one: MeasuredGrasp) -> MeasuredGrasp:
        wrong = {key: value(getattr(one, key)) for key, value in change.items()}
        return dataclasses.replace(one, **wrong) if name in ("", one.name) else one

    grasps = tuple(map(written, loaded.measured.grasps))
    return dataclasses.replace(loaded, measured=dataclasses.replace(loaded.measured, grasps=grasps))


def fitted(loaded: Loaded[MeasurementSet]) -> tuple[Target, Fit]:
    target = make_target(loaded.measured, loaded.gripper)
    problem = Problem(loaded.gripper, target.grasps)
    simulators = Simulators(problem)
    return reweigh(target, fit_exactly(target, problem, simulators, problem.start()), simulators)


def error(loaded: Loaded[MeasurementSet]) -> float:
    target, fit = fitted(loaded)
    return rms(fit.residual, target)


WRONG = [
    ("release", {"settings": lambda s: {"payload_kg": 0.45}}, "odd_recording", "payload_kg of release is not what"),
    ("waves", {"force_n": lambda f: -f}, "odd_recording", "efforts of waves are -1 times what"),
    ("ramps", {"force_n": lambda f: 1e3 * f}, "odd_recording", "efforts of ramps are 1e+03 times what"),
    ("steps", {"force_n": lambda f: 1.29 * f}, "odd_recording", "efforts of steps are 1.28 times what"),
    ("ramps", {"position_m": lambda q: q + 0.05, "command_m": lambda q: q + 0.05}, "odd_recording",
     "positions and commands of ramps are off by +0.05"),
    ("", {"time_s": lambda t: 1.03 * t}, "time_scale", "time stamps are 1.03 times too long"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "wrong", "fault", "words"), WRONG, ids=[one[3][:30] for one in WRONG])
def test_it_is_told_and_put_right(recorded, name, wrong, fault, words):
    loaded = changed(recorded, name, **wrong)
    found = {(one.name, one.words.startswith(words)): one for one in suspects(loaded, *fitted(loaded))}
    assert (fault, True) in found, [one.words for one in found.values()]
    assert error(loaded) > 1.3
    assert error(found[fault, True].put_right) < 1.05


def test_nothing_is_told_of_noise_or_of_what_all_recordings_lack(recorded, tmp_path):
    assert not suspects(recorded, *fitted(recorded))
    limited = record(tmp_path, limit=3.0)
    assert error(limited) > 1.3
    assert not suspects(limited, *fitted(limited))


@pytest.mark.long
def test_a_setting_is_fitted_and_told_in_the_answer(recorded):
    loaded = changed(recorded, "release", settings=lambda s: {"payload_kg": 0.45})
    found, _ = diagnose_set(loaded, None, ["coulomb_friction"], 0, silent)
    assert (found.verdict, found.effects) == (Verdict.DATA, ("odd_recording",))
    assert found.fault is not None
    assert found.fault.words == "payload_kg of release is 0.5, the set says 0.45"
    assert found.fault.check == "what payload_kg was in release, and recordings.csv"


@pytest.mark.long
def test_two_recordings_that_are_odd_in_the_same_way_are_both_told(recorded):
    turned = changed(recorded, "waves", force_n=lambda f: -f)
    found, _ = diagnose_set(changed(turned, "steps", force_n=lambda f: 1.29 * f), None, ["coulomb_friction"], 0, silent)
    assert (found.verdict, found.effects) == (Verdict.DATA, ("odd_recording",))
    assert found.error_after < 1.05
    assert found.fault is not None
    told = " ".join(fault.words for fault in found.fault.all)
    assert "efforts of steps are 1.29 times" in told
    assert "efforts of waves are -1 times" in told


@pytest.mark.long
def test_it_is_told_beside_an_effect_that_had_hidden_it(tmp_path, monkeypatch):
    """As if the base model had given no reason to look for it."""
    monkeypatch.setattr(import_module("forcegrasp.diagnosis.diagnose_set"), "suspects", lambda *_: [])
    loaded = changed(record(tmp_path, friction=0.15), "release", settings=lambda s: {"payload_kg": 0.35})
    found, _ = diagnose_set(loaded, None, ["coulomb_friction"], 0, silent)
    assert (found.verdict, found.effects) == (Verdict.EFFECT, ("odd_recording", "coulomb_friction"))
    assert found.fault is not None
    told = re.fullmatch(r"payload_kg of release is (.*), the set says 0.35", found.fault.words)
    assert told is not None
    assert float(told[1]) == pytest.approx(0.5, abs=0.01)


@pytest.mark.parametrize(
    ("known", "bounds", "logarithmic"), [((0.3, 0.6, 0.9), (0.075, 3.6), True), ((-0.2, 0.0, 0.1), (-0.5, 0.4), False)]
)
def test_a_setting_that_is_not_known_is_not_far_beyond_what_others_have(recorded, known, bounds, logarithmic):
    grasps = tuple(
        dataclasses.replace(one, settings={"payload_kg": value})
        for one, value in zip(recorded.measured.grasps, (*known, np.nan), strict=True)
    )
    problem = Problem(recorded.gripper, grasps)
    (entry,) = (one for one in problem.entries if one.parameter == "payload_kg")
    assert (entry.name, entry.start, entry.logarithmic) == ("payload_kg of release", known[1], logarithmic)
    assert (entry.low, entry.high) == pytest.approx(bounds)
    assert entry.value(entry.coordinate(0.2)) == pytest.approx(0.2)
    given = problem.case(problem.start()).base["payload_kg"]
    assert given == pytest.approx([*known, known[1]])
