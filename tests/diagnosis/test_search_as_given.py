"""Where effects leave only noise what is given stays as it is: to fit it beside all effects takes long."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any, cast

import pytest

from forcegrasp.diagnosis import set_search
from forcegrasp.diagnosis.givens.moved_set import MovesFirst
from forcegrasp.diagnosis.result import kept_steps
from forcegrasp.diagnosis.set_search import SetSearch, ZerosFirst
from forcegrasp.identify.progress import silent
from forcegrasp.identify.verdict import Verdict
from tests.light_set import light_set


@pytest.fixture
def as_given(made_up, monkeypatch):
    """``as_given(base=…, first=…, zeros=…, **changes)``: what comes of a search that finds an effect, told otherwise.

    ``first`` are the answers whether moves come first, of the base model and then of what was found.
    """

    def ways(base: float = 4.0, first: Sequence[bool] = (False, False), zeros: bool = False, **changes):
        left = {"error_before": 4.0, "error_after": 1.0, "floor": 1.0, "left": ""}
        found = dataclasses.replace(made_up.diagnosis("effect"), **(left | changes))
        answers, searched = list(first), []

        def before_more(moves: MovesFirst, *_) -> bool:
            moves.asked = answers.pop(0)
            moves.zeros = moves.ask_sessions and zeros
            return moves.asked

        def search(*_, stop_when):
            searched.append(stop_when)
            stop_when.given_first(None, None)
            return found

        monkeypatch.setattr(set_search, "rms_error", lambda *_: base)
        monkeypatch.setattr(MovesFirst, "before_more", before_more)
        monkeypatch.setattr(SetSearch, "search", search)
        fitted = found.target, cast(Any, None), found.base
        return SetSearch(None, [], 0, silent).search_as_given(light_set(), fitted), found, searched

    return ways


def test_it_is_told_and_looked_for_briefly(as_given):
    told, found, (stop_when,) = as_given()
    assert told == (found, True)
    assert stop_when.may_be_given(None, None)  # effects whose signatures promise too little are not fitted
    assert stop_when.goes_on


@pytest.mark.parametrize("why", [{"base": 1.4}, {"first": (True,)}])
def test_it_is_not_looked_for_where_little_is_left_or_moves_may_explain_it(as_given, why):
    told, _, searched = as_given(**why)
    assert (told, searched) == ((None, False), [])


@pytest.mark.parametrize(
    "less", [{"left": "in all"}, {"error_after": 1.6}, {"verdict": Verdict.UNKNOWN, "effects": ()}]
)
def test_it_must_explain_nearly_all_and_leave_nothing(as_given, less):
    told, found, _ = as_given(**less)
    assert told == (found, False)


def test_it_is_not_told_where_it_ended_for_moves_before_rivals_were_asked(as_given):
    told, found, _ = as_given(first=(False, True))
    assert told == (found, False)


def test_a_search_that_was_cut_short_is_told(as_given):
    told, found, _ = as_given(stopped="its 3 min were over", left="in all")
    assert told == (found, True)


def test_zeros_of_sessions_that_it_had_hidden_come_first(as_given):
    with pytest.raises(ZerosFirst):
        as_given(first=(False, True), zeros=True)


@pytest.mark.parametrize("verdict", ["effect", "unknown"])
def test_the_search_with_moves_goes_on_with_the_effects_that_it_found(made_up, monkeypatch, verdict):
    """They were found anew, for minutes."""
    found, searched = made_up.diagnosis("effect"), []
    better = dataclasses.replace(found.base)
    begun = dataclasses.replace(made_up.diagnosis(verdict), base=better)
    monkeypatch.setattr(SetSearch, "search_as_given", lambda *_: (begun, False))
    monkeypatch.setattr(SetSearch, "search_with_givens", lambda *_: None)
    monkeypatch.setattr(SetSearch, "moved", lambda *_, **__: None)

    def search(_, target, simulators, base, start=None, stop_when=None):
        searched.append((base, start))
        return found

    monkeypatch.setattr(SetSearch, "search", search)
    fitted = found.target, cast(Any, None), found.base
    assert SetSearch(None, [], 0, silent).search_and_move(light_set(), fitted) == (found, None)
    ((base, start),) = searched
    assert base is (better if verdict == "effect" else found.base)
    assert start == ((begun.fit, kept_steps(begun.steps)) if verdict == "effect" else None)
