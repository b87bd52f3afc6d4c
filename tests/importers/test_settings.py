"""Numbers of a recording that the scene takes as they are: a pendulum's mass and length, from log to simulation."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from forcegrasp.errors import ConfigError, MeasurementError
from forcegrasp.identify import loading
from forcegrasp.identify.predict import predict
from forcegrasp.identify.problem import Problem
from forcegrasp.importers.recording import Recording
from forcegrasp.importers.servo_set import as_set
from forcegrasp.measure import write_servo_set
from forcegrasp.physics import load_gripper
from forcegrasp.replay.replay import Replay

TIME = np.arange(0, 1.5, 0.005)
COMMAND = 0.8 * np.sin(4 * TIME)[:, None]
READ = np.where(TIME > 1, 0.1, 0.0)[:, None]  # at rest where it starts, and else of no account here
KP = 100


def log(name: str, **settings: float) -> Recording:
    return Recording(name, ("sts3250",), TIME, COMMAND, READ, settings={"kp": KP} | settings)


def predicted(folder: Path, *logs: Recording) -> tuple[Problem, np.ndarray]:
    """What the nominal model of a set that was written and read says, from rest, ``(recordings, samples)``."""
    loaded = loading.load(write_servo_set(as_set(list(logs), load_gripper("bam_pendulum"), "", ""), folder))
    problem = Problem(loaded.gripper, loaded.measured.grasps)
    replay = Replay(loaded.gripper, loaded.measured.grasps, encoders_known=False)
    return problem, predict(replay, [problem.case(problem.start())])[0][..., 0]


def by_mujoco(mass: float, length: float) -> np.ndarray:
    """The same by MuJoCo itself, in a scene that was changed."""
    mechanism = load_gripper("bam_pendulum")
    spec = mujoco.MjSpec.from_file(str(mechanism.model))
    spec.geom("weight").mass, spec.geom("weight").pos = mass, [0, 0, -length]
    model = spec.compile()
    gain, damping, armature = (mechanism.parameters[n].nominal for n in ("position_gain", "damping", "armature"))
    model.actuator_gainprm[0, 0], model.actuator_biasprm[0, 1] = KP * gain, -KP * gain
    model.actuator_biasprm[0, 2] = -mechanism.parameters["back_emf_damping"].nominal
    model.dof_damping[0], model.dof_armature[0] = damping, armature
    data, seen = mujoco.MjData(model), []
    for command in COMMAND[:, 0]:
        seen.append(data.qpos[0])
        data.ctrl[0] = command
        mujoco.mj_step(model, data, round(0.005 / model.opt.timestep))
    return np.array(seen)


def test_each_recording_has_its_own_pendulum(tmp_path):
    problem, seen = predicted(tmp_path / "set", log("light", mass=0.3, length=0.1), log("long", mass=1.13, length=0.12))
    assert "mass,length" in (tmp_path / "set" / "recordings.csv").read_text()
    assert not {"mass", "length"} & {entry.parameter for entry in problem.entries}  # given, and not fitted
    skew = problem.gripper.parameters["readout_skew_s"].nominal
    for one, (mass, length) in zip(seen, ((0.3, 0.1), (1.13, 0.12)), strict=True):
        expected = np.interp(TIME + skew, TIME, by_mujoco(mass, length))
        assert np.abs(one - expected)[: len(TIME) - 2].max() < 2e-3
    assert np.abs(seen[0] - seen[1]).max() > 0.05


def test_without_them_the_scene_stays_as_it_is(tmp_path):
    _, seen = predicted(tmp_path / "set", log("a"), log("b"))
    _, same = predicted(tmp_path / "same", log("a", mass=0.5, length=0.1), log("b", mass=0.5, length=0.1))
    np.testing.assert_allclose(seen, same, atol=1e-9)


def test_what_only_some_recordings_say_is_refused(tmp_path):
    with pytest.raises(MeasurementError, match="mass"):
        predicted(tmp_path / "set", log("a", mass=0.5), log("b"))


@pytest.mark.parametrize(
    ("written", "told"),
    [
        ("settings: {mass: []}", "settings.mass: must name a field of the model, such as `body_mass`"),
        ("settings: {damping: [body_mass]}", "settings.damping: is among the parameters, too"),
        ("settings: {mass: [body_weight]}", "settings.mass: body_weight is no field of numbers"),
        ("settings: {mass: [mass]}", "'mass' must look like"),
    ],
)
def test_a_description_that_can_not_be_right(tmp_path, written, told):
    shipped = load_gripper("bam_pendulum")
    text = shipped.path.read_text()
    (tmp_path / shipped.model.name).write_text(shipped.model.read_text())
    (tmp_path / "mine.yaml").write_text(text[: text.index("settings:")] + written)
    with pytest.raises(ConfigError) as refused:
        load_gripper(str(tmp_path / "mine.yaml"))
    assert told in str(refused.value)
