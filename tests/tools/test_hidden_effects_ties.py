"""Ties of the campaign: what is recorded next, and when it ends."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

from forcegrasp.diagnosis import diagnose_set as diagnosing
from forcegrasp.identify.verdict import Verdict
from tests.independent.rig import record
from tools.hidden_effects_ties import settle


@pytest.fixture
def tie(made_up, tmp_path, monkeypatch):
    """``tie(*verdicts)``: what is told where further diagnoses come to these in turn; and the sets joined."""
    truth = record(tmp_path / "set", {}, 5, grasps=2, samples=60)
    menu = [
        made_up.advice.next_grasp.model_copy(update={"grasp": kind, "object": truth.grasps[0]["object"]})
        for kind in ("slow ramp", "long hold", "fast step")
    ]
    advice = dataclasses.replace(made_up.advice, next_grasp=menu[1], menu=tuple(menu))
    monkeypatch.setattr("forcegrasp.diagnosis.advice.advise", lambda diagnosis: advice)

    def told(*verdicts: Verdict) -> tuple[dict, list]:
        joined, coming = [], iter(verdicts)

        def diagnose_set(loaded, *_):
            joined.append(loaded.measured)
            return SimpleNamespace(verdict=next(coming), effects=("backlash",), target=made_up.target), None

        monkeypatch.setattr(diagnosing, "diagnose_set", diagnose_set)
        return settle(tmp_path, truth, made_up.diagnosis("one_of")), joined

    return told


def test_grasps_are_recorded_until_one_effect_is_left_or_two_were(tie):
    further, joined = tie(Verdict.ONE_OF, Verdict.ONE_OF, Verdict.EFFECT)
    assert [len(one.grasps) for one in joined] == [3, 4, 3]
    told = {"grasp": "long hold", "verdict": "one_of", "effects": ["backlash"]}
    assert further["proposed"] == [told, told]
    (chance,) = further["chance"]
    assert chance["verdict"] == "effect"
    assert chance["grasp"] in ("slow ramp", "long hold", "fast step")
    (first, second) = joined[1].grasps[2:]
    np.testing.assert_array_equal(first.command_m, second.command_m)
    assert not np.array_equal(first.force_n, second.force_n)  # of other noise
