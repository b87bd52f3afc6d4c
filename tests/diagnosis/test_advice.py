"""Which two effects the next grasp is to tell apart, and what it is chosen from."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from forcegrasp.diagnosis.advice import advise, rivals_of
from forcegrasp.diagnosis.result import Diagnosis, Step
from forcegrasp.effects import get_effect
from forcegrasp.effects.setting import EffectSetting
from forcegrasp.replay.plans import MENU, OFF_CENTRE


@pytest.fixture
def with_steps(made_up):
    """``with_steps(*pairs)``: a diagnosis of such steps; each is the effects found, and those that were refitted."""
    one, other = made_up.diagnosis("effect").steps[0].candidates
    fits = {c.effect.name: c for c in (one, other)}
    for name in ("force_lag", "backlash"):
        setting = dataclasses.replace(one.setting, effect=get_effect(name))
        fits[name] = dataclasses.replace(other, setting=setting)
    swapped = EffectSetting(get_effect("swapped_forces"), "", np.array([0.05]))
    fits["swapped_forces"] = dataclasses.replace(other, setting=swapped)

    def diagnosis(*steps: tuple[tuple[str, ...], tuple[str, ...]]) -> Diagnosis:
        made = tuple(Step(found, tuple(fits[name] for name in tried), (), 2.0, 1.5) for found, tried in steps)
        return dataclasses.replace(made_up.diagnosis("effect"), steps=made)

    return diagnosis


@pytest.mark.parametrize(
    ("steps", "rivals"),
    [
        # an effect that was found without a doubt after a tie leaves the tie as it was
        (
            [
                (("force_bias", "force_drift"), ("force_bias", "force_drift")),
                (("force_lag",), ("force_lag", "backlash")),
            ],
            ("force_bias", "force_drift"),
        ),
        # of a tie that was settled in part, what is left of it
        ([(("force_bias", "backlash"), ("force_bias", "force_drift", "backlash"))], ("force_bias", "backlash")),
        # no tie: the best two of the last step that found something
        (
            [
                (("force_bias",), ("force_bias", "force_drift")),
                (("force_lag",), ("force_lag", "backlash")),
                ((), ("backlash", "force_drift")),
            ],
            ("force_lag", "backlash"),
        ),
        # one that another step has found is no rival
        (
            [
                (("force_bias",), ("force_bias", "force_lag", "force_drift")),
                (("force_lag",), ("force_lag",)),
            ],
            ("force_bias", "force_drift"),
        ),
        # columns that would be swapped by 5 %: something else
        ([(("force_bias",), ("force_bias", "swapped_forces", "force_drift"))], ("force_bias", "force_drift")),
        # nothing found: the two that came nearest to it
        ([((), ("backlash", "force_drift"))], ("backlash", "force_drift")),
    ],
)
def test_the_next_grasp_is_to_settle_a_tie(with_steps, steps, rivals):
    found = rivals_of(with_steps(*steps))
    assert found is not None
    assert tuple(one.effect.name for one in found) == rivals


def test_it_is_chosen_from_the_whole_menu(with_steps):
    advice = advise(with_steps((("force_bias", "force_drift"), ("force_bias", "force_drift"))))
    assert advice is not None
    kinds = [one.grasp for one in advice.menu]
    assert kinds == list(advice.bits) == list(advice.differences)
    assert set(kinds) == {*MENU, OFF_CENTRE} - {"close and hold"}
    assert advice.next_grasp in advice.menu
    assert advice.rivals == ("force_bias", "force_drift")


def test_without_two_effects_there_is_nothing_to_tell_apart(with_steps):
    assert advise(with_steps((("force_bias",), ("force_bias",)))) is None
    assert rivals_of(with_steps()) is None


def test_a_grasp_that_tells_next_to_nothing_is_not_asked_for(with_steps, monkeypatch):
    tied = with_steps((("force_bias", "force_drift"), ("force_bias", "force_drift")))
    monkeypatch.setattr("forcegrasp.diagnosis.advice.expected_bits", lambda *_: 0.12)
    assert advise(tied) is None
