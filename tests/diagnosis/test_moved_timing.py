"""Positions that are late by no more than the set's tolerance are no missing effect."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from forcegrasp.diagnosis.givens.moved_set import timing_within_tolerance_after_all
from forcegrasp.effects import get_effect
from forcegrasp.effects.setting import EffectSetting
from forcegrasp.identify.problem import Problem
from forcegrasp.identify.verdict import Verdict
from forcegrasp.reports.diagnosis_answer import answer
from tests.made_up import fit_of

DELAY_STD_S = 0.002


@pytest.fixture
def late(made_up):
    """``late(0.003, "backlash")``: positions are late by so much, and effects were found besides."""

    def found(delay_s: float, *others: str, **changed):
        one = made_up.diagnosis("effect")
        fit, (step,) = one.fit, one.steps
        setting = EffectSetting(get_effect("readout_skew"), "", np.array([delay_s]))
        problem = Problem(fit.problem.gripper, fit.problem.grasps, [setting])
        fit = fit_of(problem, made_up.target, fit.residual)
        names = (*others, "readout_skew")
        steps = tuple(dataclasses.replace(step, effects=(name,)) for name in names)
        return dataclasses.replace(one, effects=names, steps=steps, fit=fit, **changed)

    return found


def set_of(made_up, delay_std_s: float = DELAY_STD_S):
    measured = dataclasses.replace(made_up.loaded.measured, delay_std_s=delay_std_s)
    return dataclasses.replace(made_up.loaded, measured=measured)


def test_alone_they_are_moved_and_nothing_is_missing(made_up, late):
    found = timing_within_tolerance_after_all(late(0.003, left=""), set_of(made_up))
    assert (found.verdict, found.effects, found.steps) == (Verdict.EXPLAINED, (), ())
    assert "What the set gives was moved within its tolerance: time of reading by +3 ms" in answer(found)
    assert timing_within_tolerance_after_all(late(0.003, left="in all"), set_of(made_up)).verdict is Verdict.UNKNOWN


def test_besides_an_effect_that_stays(made_up, late):
    found = timing_within_tolerance_after_all(late(0.003, "force_bias"), set_of(made_up))
    assert (found.verdict, found.effects) == (Verdict.EFFECT, ("force_bias",))
    assert [step.effects for step in found.steps] == [("force_bias",)]


def test_what_was_moved_before_is_told_first(made_up, late):
    alone = timing_within_tolerance_after_all(late(0.003), set_of(made_up)).fault
    assert alone is not None
    before = dataclasses.replace(alone, words="radius of foam by +0.1 mm")
    found = timing_within_tolerance_after_all(late(0.003, fault=before), set_of(made_up))
    assert found.fault is not None
    assert found.fault.words == "radius of foam by +0.1 mm; then, within its tolerance, time of reading by +3 ms"


@pytest.mark.parametrize(("delay_s", "std_s"), [(0.0041, DELAY_STD_S), (0.003, 0.001), (0.003, 0.0)])
def test_beyond_the_tolerance_they_are_an_effect(made_up, late, delay_s, std_s):
    found = late(delay_s, "force_bias")
    assert timing_within_tolerance_after_all(found, set_of(made_up, std_s)) is found
