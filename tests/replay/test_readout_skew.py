"""Readings taken later than their commands: interpolated by hand, and found again without more simulations."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from forcegrasp.errors import ConfigError
from forcegrasp.identify.fit import fit_once
from forcegrasp.identify.fit_set import apply_model
from forcegrasp.identify.fitted_model import model_of
from forcegrasp.identify.loading import Loaded
from forcegrasp.identify.problem import Problem
from forcegrasp.identify.progress import silent
from forcegrasp.identify.simulators import Simulators
from forcegrasp.identify.target import make_target
from forcegrasp.importers.example import example_set
from forcegrasp.measure.schema import MeasuredGrasp, columns_of
from forcegrasp.models.model_file import read_model, write_model
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


def test_each_recordings_skew_is_found_kept_and_costs_no_simulation(monkeypatch, tmp_path):
    """The jaw's is of each recording: a logger starts anew for each."""
    found, rows, hidden = [], np.arange(3), np.array([0.0137, -0.006, 0.0202])
    measured = example_set()
    grasps = [dataclasses.replace(g, start=(g.command_m[0], np.zeros(1))) for g in measured.grasps[2:5]]
    replay = Replay(JAW, grasps, encoders_known=False)
    read = replay.read(replay.simulate(rows, nominal(3)), rows, np.ones(3), skew_s=hidden).position
    noisy = read + 1e-4 * np.random.default_rng(0).standard_normal(read.shape)
    grasps = tuple(dataclasses.replace(g, position_m=p, start=None) for g, p in zip(grasps, noisy, strict=True))
    target = make_target(dataclasses.replace(measured, grasps=grasps), JAW)
    problem = Problem(JAW, target.grasps)
    simulate = Replay.simulate
    monkeypatch.setattr(Replay, "simulate", lambda *a, **o: found.append(len(a[1])) or simulate(*a, **o))
    fit = fit_once(target, problem, Simulators(problem), problem.start())
    assert max(found) == (len(JAW.parameters) - 1) * len(target.grasps)  # slopes of all others
    model = model_of(fit, target, Loaded(dataclasses.replace(measured, grasps=grasps), JAW, []), [])
    write_model(model, tmp_path / "model.yaml")
    again = read_model(tmp_path / "model.yaml")
    assert SKEW not in again.base
    for grasp, skew_s in zip(grasps, hidden, strict=True):
        fitted = again.grasps[grasp.session][SKEW]
        assert fitted.value == pytest.approx(skew_s, abs=6e-4)
        assert fitted.low < skew_s < fitted.high

    # a model stands beside the set that it was fitted to as it is; of other recordings the skew is fitted
    _, _, known = apply_model(Loaded(dataclasses.replace(measured, grasps=grasps), JAW, []), again, silent, refit=False)
    np.testing.assert_allclose(known.fit.values, fit.values, rtol=1e-3)
    others = tuple(dataclasses.replace(g, name=f"{g.name}x", session=f"{g.session}x") for g in grasps)
    told: list[str] = []
    other = Loaded(dataclasses.replace(measured, grasps=others), JAW, [])
    _, _, fitted_anew = apply_model(other, again, told.append, refit=False)
    np.testing.assert_allclose(fitted_anew.fit.values, fit.values, rtol=0.05)
    assert told[0].startswith(f"the model does not say {SKEW} of {others[0].session}, ")


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
