"""Time stamps on the straight line through them; and is the scatter of a set that of its log, or of its readings?"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from forcegrasp.diagnosis.diagnose_set import diagnose_set
from forcegrasp.diagnosis.faults.even_stamps import are_even_in_truth, evenly
from forcegrasp.identify.base_fit import rms_error
from forcegrasp.identify.fit_set import fit_model
from forcegrasp.identify.predict import predict
from forcegrasp.identify.progress import silent
from forcegrasp.replay.record import parse_effect
from forcegrasp.replay.replay import Replay
from forcegrasp.reports.diagnosis_answer import answer
from tests.light_set import light_set


def uneven(grasp, seed: int, spread_s: float = 0.008):
    jitter = np.random.default_rng(seed).uniform(-spread_s, spread_s, len(grasp.time_s))
    return dataclasses.replace(grasp, time_s=grasp.time_s + jitter)


def with_grasps(loaded, grasps):
    return dataclasses.replace(loaded, measured=dataclasses.replace(loaded.measured, grasps=tuple(grasps)))


def test_rows_that_are_missing_stay_so():
    grasp = uneven(light_set().measured.grasps[0], 0)
    keep = np.delete(np.arange(len(grasp.time_s)), [10, 30, 31])
    fields = ("time_s", "command_m", "position_m", "force_n")
    fewer = dataclasses.replace(grasp, **{name: getattr(grasp, name)[keep] for name in fields})
    assert evenly(fewer).time_s == pytest.approx(0.04 * keep, abs=0.006)
    assert np.diff(evenly(fewer).time_s) == pytest.approx(0.04 * np.diff(keep), rel=0.01)


@pytest.mark.parametrize(("hidden", "error"), [((), 1.3), (("coulomb_friction",), 4.0)])
@pytest.mark.parametrize("of_log", [True, False])
def test_only_a_log_that_scatters_by_itself_is_doubted(of_log, hidden, error):
    """Whatever the model lacks besides."""
    loaded = light_set(*hidden, grasps=6)
    grasps = [uneven(g, i) for i, g in enumerate(loaded.measured.grasps)]
    if not of_log:  # they were read when their stamps say so
        _, _, base = fit_model(loaded, 0, silent)
        effects = tuple(parse_effect(text, loaded.gripper) for text in hidden)
        case = dataclasses.replace(base.fit.problem.case(base.fit.vector), effects=effects)
        read = predict(Replay(loaded.gripper, grasps), [case])[0]
        noise = np.random.default_rng(1).standard_normal(read.shape) * [2e-5, 2e-5, 0.01, 0.01]
        grasps = [
            dataclasses.replace(g, position_m=r[: len(g.time_s), :2], force_n=r[: len(g.time_s), 2:])
            for g, r in zip(grasps, read + noise, strict=True)
        ]
    target, _, base = fit_model(with_grasps(loaded, grasps), 0, silent)
    if of_log or hidden:
        assert rms_error(base.fit, target) > error
    assert are_even_in_truth(target, base.fit) is of_log


@pytest.mark.long
def test_it_is_told_beside_an_effect():
    loaded = light_set("coulomb_friction")
    grasps = [uneven(g, i) for i, g in enumerate(loaded.measured.grasps)]
    diagnosis, _ = diagnose_set(with_grasps(loaded, grasps), None, ["coulomb_friction", "stiction"], 0, silent)
    assert (diagnosis.verdict, diagnosis.effects) == ("effect", ("uneven_stamps", "coulomb_friction"))
    assert diagnosis.error_after < 1.05
    assert "The set seems to be wrong: uneven_stamps (time stamps scatter by 4" in answer(diagnosis)


def test_even_stamps_are_not_looked_at(monkeypatch):
    target, _, base = fit_model(light_set(grasps=6), 0, silent)
    monkeypatch.setattr("forcegrasp.diagnosis.faults.even_stamps.predict", lambda *_: pytest.fail("simulated"))
    assert not are_even_in_truth(target, base.fit)
