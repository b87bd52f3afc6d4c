"""A search that began with the scene's own physics steps goes on with larger ones where these lead nothing astray."""

from __future__ import annotations

import dataclasses

import pytest

from forcegrasp.diagnosis.diagnose_set import diagnose_set
from forcegrasp.identify import larger_steps
from forcegrasp.identify.larger_steps import with_own_steps
from tests.light_set import light_set


@pytest.mark.parametrize("astray", [False, True])
def test_larger_steps_come_back_with_what_was_found(monkeypatch, astray):
    told = []
    monkeypatch.setattr(larger_steps, "lead_astray", lambda fit, target: astray)
    loaded = light_set("force_lag time_constant_s=0.1", grasps=6, samples=60)
    quick = dataclasses.replace(loaded.gripper, fast="sphere")
    loaded = dataclasses.replace(loaded, gripper=with_own_steps(quick))
    diagnosis, _ = diagnose_set(loaded, None, ["force_lag"], 0, told.append)
    assert (diagnosis.verdict, diagnosis.effects) == ("effect", ("force_lag",))
    assert diagnosis.fit.problem.gripper.own_steps == astray
    assert any("with larger physics steps" in line for line in told) == (not astray)
