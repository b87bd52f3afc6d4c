"""Where nothing pulls a joint back, how fast it moves at a window's start is a parameter of the window."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from forcegrasp.errors import ConfigError
from forcegrasp.identify.predict import predict
from forcegrasp.identify.problem import Problem
from forcegrasp.measure.schema import MeasuredGrasp, columns_of
from forcegrasp.physics import load_gripper
from forcegrasp.physics.gripper import START_VELOCITY
from forcegrasp.replay.replay import Replay

PENDULUM = load_gripper("dfki_pendulum")
TIME = np.arange(30) / 300


def test_it_is_added_to_the_measured_one():
    still = MeasuredGrasp(
        "one", "", "one", None, None, None, TIME, np.zeros((30, 1)), np.zeros((30, 1)), np.empty((30, 0)), None,
        columns=columns_of(PENDULUM), start=(np.zeros(1), np.zeros(1)),
    )  # fmt: skip
    problem, replay = Problem(PENDULUM, [still]), Replay(PENDULUM, [still])
    start, at = problem.start(), [entry.parameter for entry in problem.entries].index(START_VELOCITY)
    pushed = start.copy()
    pushed[at] = problem.entries[at].coordinate(0.2)
    plain, moved = predict(replay, [problem.case(start), problem.case(pushed)])[:, 0, :, 0]
    assert not plain.any()
    assert np.gradient(moved, TIME)[1] == pytest.approx(0.2, rel=0.02)


def test_mechanisms_of_several_motors_do_not_have_it(tmp_path):
    arm = Path(__file__).parents[1] / "mechanisms" / "arm.yaml"
    shutil.copy(arm.with_suffix(".xml"), tmp_path)
    line = "  start_velocity: {nominal: 0, low: -5, high: 5, unit: rad/s, scope: grasp, writes: []}\n"
    (tmp_path / "arm.yaml").write_text(arm.read_text().replace("parameters:\n", "parameters:\n" + line))
    with pytest.raises(ConfigError, match=r"start_velocity.*one motor"):
        load_gripper(str(tmp_path / "arm.yaml"))
