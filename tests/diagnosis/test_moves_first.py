"""Moves of what a set gives come before further effects, where they explain most of what the known ones leave."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from forcegrasp.diagnosis import set_search
from forcegrasp.diagnosis.givens import moved_set
from forcegrasp.diagnosis.givens.moved_set import MovesFirst
from forcegrasp.diagnosis.result import Step, kept_steps
from forcegrasp.diagnosis.search.refine import fit_with
from forcegrasp.diagnosis.search.stop_when import never
from forcegrasp.diagnosis.set_search import SetSearch
from forcegrasp.diagnosis.study import Study
from forcegrasp.effects.for_gripper import effect_of
from forcegrasp.effects.setting import EffectSetting
from forcegrasp.identify.fit_set import fit_model
from forcegrasp.identify.progress import silent
from tests.light_set import light_set


@pytest.mark.parametrize(
    ("by_m", "first"),
    [((1e-4, -1e-4, 1e-4), True), ((-1e-4, -1e-4, -1e-4), False), ((4e-4, -4e-4, 4e-4), True)],
)
def test_radii_that_are_off_either_way_come_before_more_effects(by_m, first):
    """Alike it may be lost motion that holds pads apart; and four times as much is no tolerance of a calliper."""
    loaded = light_set("force_bias left_n=0.05 right_n=-0.02", grasps=9)
    off = dict(zip(dict.fromkeys(grasp.object for grasp in loaded.measured.grasps), by_m, strict=True))
    grasps = tuple(dataclasses.replace(g, radius_m=g.radius_m - off[g.object]) for g in loaded.measured.grasps)
    given = dataclasses.replace(loaded, measured=dataclasses.replace(loaded.measured, grasps=grasps))
    target, simulators, base = fit_model(given, 0, silent)
    bias = EffectSetting(effect_of("force_bias", given.gripper), "", np.array([0.05, -0.02]))
    fit = fit_with([bias], base.fit.vector, Study(target, simulators, ()), base.fit)
    moves = MovesFirst(given)
    assert moves.explain(target, fit) is (first and max(by_m) < 3e-4)
    assert not moves.asked  # it is a question about a fit alone
    assert moves.before_more(target, fit) is first
    assert moves.asked is first
    assert moves.beyond is (max(by_m) > 3e-4)


@pytest.mark.parametrize(("left", "first"), [(1.4, True), (1.6, False)])
def test_moves_that_leave_much_do_not_come_first(monkeypatch, left, first):
    """An effect that is not known yet has its part in the move then."""
    moved = SimpleNamespace(is_within=True, smaller_m=0.0, radii_differ_by_m=0.0)
    monkeypatch.setattr(moved_set, "first_move", lambda *_: (moved, left))
    moves = MovesFirst(light_set(), ask_sessions=False)
    assert moves.before_more(cast(Any, None), cast(Any, None)) is first
    assert not moves.beyond


@pytest.mark.parametrize("of_none", [False, True])
def test_a_search_that_ended_for_a_move_that_was_none_goes_on_where_it_stood(made_up, monkeypatch, of_none):
    """Unless what is missing is in no catalogue, which is no other when it is asked again."""
    found, begun = made_up.diagnosis("effect"), []
    found = dataclasses.replace(found, steps=(*found.steps, Step((), (), (), 2.0, 2.0, of_none=of_none)))
    first = SimpleNamespace(asked=True, beyond=False, zeros=False, before_more=never, explain=never)
    monkeypatch.setattr(set_search, "MovesFirst", lambda *_: first)
    monkeypatch.setattr(SetSearch, "moved", lambda *_, **__: None)
    monkeypatch.setattr(SetSearch, "search", lambda *_, start=None, stop_when=None: begun.append(start) or found)
    loaded = SimpleNamespace(gripper=found.target.gripper)
    assert SetSearch(None, [], 0, silent).search_as_it_is(loaded, (found.target, None, found.base)) == (found, None)
    again = [] if of_none else [(found.fit, kept_steps(found.steps))]
    assert begun == [None, *again]


@pytest.mark.parametrize("verdict", ["effect", "unknown"])
def test_it_goes_on_with_what_was_not_believed_and_keeps_what_it_adds_up_to(made_up, monkeypatch, verdict):
    """A motor that fades was load friction for twelve minutes, and again when it was asked for a third time."""
    bolder, again, begun = made_up.diagnosis("effect"), made_up.diagnosis(verdict), []
    first = dataclasses.replace(made_up.diagnosis("unknown"), bolder=bolder)
    asked = SimpleNamespace(asked=True, beyond=False, zeros=False, before_more=never, explain=never)
    monkeypatch.setattr(set_search, "MovesFirst", lambda *_: asked)
    monkeypatch.setattr(SetSearch, "moved", lambda *_, **__: None)

    def search(*_, start=None, stop_when=None):
        begun.append(start)
        return again if start else first

    monkeypatch.setattr(SetSearch, "search", search)
    loaded = SimpleNamespace(gripper=first.target.gripper)
    found = SetSearch(None, [], 0, silent).search_as_it_is(loaded, (first.target, None, first.base))
    assert begun == [None, (bolder.fit, kept_steps(bolder.steps))]
    assert found == (again if verdict == "effect" else first, None)
