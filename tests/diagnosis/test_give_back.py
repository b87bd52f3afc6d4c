"""What a set was moved by is taken back where an effect that was found only then does without it."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from forcegrasp.diagnosis.diagnose_set import diagnose_set
from forcegrasp.diagnosis.faults.fault import Fault
from forcegrasp.diagnosis.faults.tolerance import Moved
from forcegrasp.diagnosis.givens import give_back
from forcegrasp.diagnosis.givens.give_back import without_move
from forcegrasp.diagnosis.result import Step
from forcegrasp.diagnosis.set_search import SetSearch
from forcegrasp.effects.for_gripper import effect_of
from forcegrasp.identify.givens import givens_of
from forcegrasp.identify.progress import silent
from forcegrasp.identify.target import make_target
from tests.light_set import light_set

# Standard deviations of a calliper by which radii are moved, of three objects.
MOVES = (1.5, -1.2, 0.9)


@pytest.fixture(scope="module")
def as_truly():
    return light_set("force_lag time_constant_s=0.08", grasps=9, samples=54)


def with_grasps(loaded, change):
    grasps = tuple(change(grasp) for grasp in loaded.measured.grasps)
    return dataclasses.replace(loaded, measured=dataclasses.replace(loaded.measured, grasps=grasps))


def moves_of(loaded) -> Moved:
    numbers = givens_of(loaded.measured, make_target(loaded.measured, loaded.gripper))
    radii = tuple(number for number in numbers if number.kind == "radius_m")
    return Moved(radii, np.array(MOVES))


def diagnosed(loaded, names):
    return diagnose_set(loaded, None, names, 0, silent)[0]


def search_on(loaded):
    """Goes on with the one effect that is hidden."""
    lag = effect_of("force_lag", loaded.gripper)
    return SetSearch(None, [lag], 0, silent)._search_on


@pytest.mark.long
@pytest.mark.parametrize("truly_off", [False, True])
def test_a_move_is_taken_back_unless_grasps_ask_for_it(as_truly, truly_off):
    """Of a set whose radii are as said, or off by what they are moved."""
    said, moved = as_truly, moves_of(as_truly)
    if truly_off:
        back = Moved(moved.numbers, -4 * moved.deviations)
        said = with_grasps(as_truly, back.put)
        moved = Moved(moved.numbers, 4 * moved.deviations)
    right = with_grasps(said, moved.put)
    found = diagnosed(said, ["force_bias"])
    fault = Fault("object_tolerance", moved.words(), moved.check, right, moved)
    further = dataclasses.replace(diagnosed(right, ["force_lag"]), fault=fault)
    assert "force_lag" in further.effects
    given_back = without_move(further, found, search_on(said), silent)
    assert (given_back is None) == truly_off
    if given_back is not None:
        diagnosis, _ = given_back
        assert (diagnosis.verdict, diagnosis.effects, diagnosis.fault) == ("effect", ("force_lag",), None)
        assert diagnosis.fit.values[-1] == pytest.approx(0.08, rel=0.05)
        assert not diagnosis.left
        assert diagnosis.target.grasps == found.target.grasps


def test_it_is_not_asked_where_nothing_new_was_found(as_truly):
    moved = moves_of(as_truly)
    found = diagnosed(as_truly, ["force_lag"])
    fault = Fault("object_tolerance", moved.words(), moved.check, as_truly, moved)
    for further in (dataclasses.replace(found, fault=fault), found):
        assert without_move(further, found, search_on(as_truly), silent) is None


def test_what_explains_most_comes_first(made_up, monkeypatch):
    bias, drift = made_up.diagnosis("one_of").steps[0].candidates
    steps = [Step((c.effect.name,), (c,), (), 2.0, 1.0) for c in (bias, drift)]
    rounding = Step(("quantisation",), (), (), 2.0, 1.0)
    costs = {"force_bias": 10.0, "force_drift": 1000.0}
    monkeypatch.setattr(give_back, "roughly_without", lambda name, *_, **__: SimpleNamespace(cost=costs[name]))
    ordered = give_back._by_what_absence_costs(cast(Any, None), [*steps, rounding], cast(Any, None))
    assert [step.effects[0] for step in ordered] == ["quantisation", "force_drift", "force_bias"]
