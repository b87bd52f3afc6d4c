"""Readings taken later than their commands: interpolated by hand, and found again without more simulations."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from forcegrasp.errors import ConfigError
from forcegrasp.identify.fit import Simulators, fit_once
from forcegrasp.identify.problem import Problem
from forcegrasp.identify.target import make_target
from forcegrasp.importers.example import example_set
from forcegrasp.measure.schema import MeasuredGrasp, columns_of
from forcegrasp.physics import load_gripper
from forcegrasp.physics.gripper import SKEW
from forcegrasp.replay.replay import Replay

JAW = load_gripper("so101_jaw")
TIME = np.arange(60) * 0.02
COMMAND = 0.5 + 0.3 * np.sin(6 * TIME)[:, None]
ONE = MeasuredGrasp(
    "one", "", "one", None, None, None, TIME, COMMAND, COMMAND, np.empty((60, 0)), None, columns=columns_of(JAW),
    start=(COMMAND[0], np.zeros(1)),
)  # fmt: skip


def nominal(rows: int) -> dict[str, np.ndarray]:
    return {name: np.full(rows, p.nominal) for name, p in JAW.parameters.items()}


@pytest.mark.parametrize("skew_s", [-0.011, 0.0, 0.0031, 0.03])
def test_a_late_reading_is_the_motion_at_that_later_time(skew_s):
    replay, rows = Replay(JAW, [ONE]), np.arange(1)
    motion = replay.simulate(rows, nominal(1))
    read = replay.read(motion, rows, np.ones(1), skew_s=np.array([skew_s])).position[0, :, 0]
    moments = replay.dt * np.arange(motion.position.shape[1])
    np.testing.assert_allclose(read, np.interp(TIME + skew_s, moments, motion.position[0, :, 0]), atol=1e-12)
    assert moments[-1] >= TIME[-1] + JAW.parameters[SKEW].high


def test_no_skew_reads_what_a_plain_replay_reads():
    replay, rows = Replay(JAW, [ONE]), np.arange(1)
    motion = replay.simulate(rows, nominal(1))
    plain, late = (replay.read(motion, rows, np.ones(1), skew_s=s).position for s in (None, np.zeros(1)))
    np.testing.assert_array_equal(plain, late)


def test_a_hidden_skew_is_found_and_its_slope_costs_no_simulation(monkeypatch):
    found, rows = [], np.arange(3)
    measured = example_set()
    grasps = [dataclasses.replace(g, start=(g.command_m[0], np.zeros(1))) for g in measured.grasps[2:5]]
    replay = Replay(JAW, grasps, encoders_known=False)
    read = replay.read(replay.simulate(rows, nominal(3)), rows, np.ones(3), skew_s=np.full(3, 0.0137)).position
    noisy = read + 1e-4 * np.random.default_rng(0).standard_normal(read.shape)
    grasps = tuple(dataclasses.replace(g, position_m=p, start=None) for g, p in zip(grasps, noisy, strict=True))
    target = make_target(dataclasses.replace(measured, grasps=grasps), JAW)
    problem = Problem(JAW, target.grasps)
    simulate = Replay.simulate
    monkeypatch.setattr(Replay, "simulate", lambda *a, **o: found.append(len(a[1])) or simulate(*a, **o))
    fit = fit_once(target, problem, Simulators(problem), problem.start())
    values = dict(zip((e.name for e in problem.entries), fit.values, strict=True))
    assert values[SKEW] == pytest.approx(0.0137, abs=4e-4)
    assert max(found) == (len(JAW.parameters) - 1) * len(target.grasps)  # slopes of all others


@pytest.mark.parametrize(
    ("old", "new", "match"),
    [
        ("unit: s, scope: gripper, writes: []", "unit: s, scope: gripper, writes: [dof_damping]", "must be \\[\\]"),
        (
            "scope: gripper, writes: [dof_damping]",
            "scope: gripper, writes: []",
            "parameters.damping.writes: must name a field",
        ),
    ],
)
def test_a_description_says_fields_for_all_but_the_skew(old, new, match, tmp_path):
    shipped = load_gripper("xl330_pendulum")
    text = shipped.path.read_text()
    assert old in text
    (tmp_path / shipped.model.name).write_text(shipped.model.read_text())
    (tmp_path / "mine.yaml").write_text(text.replace(old, new))
    with pytest.raises(ConfigError, match=match):
        load_gripper(str(tmp_path / "mine.yaml"))
