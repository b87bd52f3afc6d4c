"""Where one effect leaves only noise what is given stays as it is: to fit it beside all effects takes long."""

from __future__ import annotations

import dataclasses
from typing import Any, cast

import pytest

from forcegrasp.diagnosis import diagnose_set
from forcegrasp.diagnosis.diagnose_set import _Ways, _ZerosFirst
from forcegrasp.diagnosis.givens.moved_set import MovesFirst
from forcegrasp.identify.progress import silent
from forcegrasp.identify.verdict import Verdict
from tests.light_set import light_set


@pytest.fixture
def alone(made_up, monkeypatch):
    """``alone(base=…, moves=…, zeros=…, **changes)``: what comes of a search that finds one effect, told otherwise."""

    def ways(base: float = 4.0, moves: bool = False, zeros: bool = False, **changes):
        left = {"error_before": 4.0, "error_after": 1.0, "floor": 1.0, "left": ""}
        found = dataclasses.replace(made_up.diagnosis("effect"), **(left | changes))
        monkeypatch.setattr(diagnose_set, "rms_error", lambda *_: base)
        monkeypatch.setattr(MovesFirst, "before_more", lambda *_: moves)
        monkeypatch.setattr(diagnose_set, "of_sessions", lambda *_: [None] * zeros)
        searched = []
        monkeypatch.setattr(_Ways, "search", lambda *_, stop_when: searched.append(stop_when) or found)
        fitted = found.target, cast(Any, None), found.base
        told = _Ways(None, [], 0, silent).one_effect_alone(light_set(), fitted)
        return told, found, searched

    return ways


def test_it_is_told_and_looked_for_briefly(alone):
    told, found, (stop_when,) = alone()
    assert told is found
    assert stop_when.may_be_given(None, None)  # effects whose signatures promise too little are not fitted
    assert stop_when.given_first(None, None)  # nor is a second one looked for


@pytest.mark.parametrize("why", [{"base": 1.4}, {"moves": True}])
def test_it_is_not_looked_for_where_little_is_left_or_moves_may_explain_it(alone, why):
    told, _, searched = alone(**why)
    assert (told, searched) == (None, [])


@pytest.mark.parametrize("step", [0, 2])
def test_there_must_be_one(alone, made_up, step):
    told, *_ = alone(steps=made_up.diagnosis("effect").steps * step)
    assert told is None


@pytest.mark.parametrize(
    "less", [{"left": "in all"}, {"error_after": 1.6}, {"verdict": Verdict.UNKNOWN, "effects": ()}]
)
def test_it_must_explain_nearly_all_and_leave_nothing(alone, less):
    told, *_ = alone(**less)
    assert told is None


def test_a_search_that_was_cut_short_is_told(alone):
    told, found, _ = alone(stopped="its 3 min were over", steps=())
    assert told is found


def test_zeros_of_sessions_that_it_had_hidden_come_first(alone, made_up):
    with pytest.raises(_ZerosFirst):
        alone(zeros=True, steps=made_up.diagnosis("effect").steps * 2)
    told, found, _ = alone(zeros=True)
    assert told is found  # it leaves nothing for them to explain
