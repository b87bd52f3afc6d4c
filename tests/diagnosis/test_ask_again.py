"""What could not be told apart is asked again of the whole model."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from forcegrasp.diagnosis.ask_again import ask_again
from forcegrasp.diagnosis.result import Step
from forcegrasp.effects.for_gripper import effect_of
from forcegrasp.effects.setting import EffectSetting
from forcegrasp.identify.fit_set import fit_model
from tests.diagnosis.test_families import jaw_with, silent
from tests.diagnosis.test_needless import step_with

FRICTION, DEADBAND, LAG = "coulomb_friction", "position_deadband", "actuator_lag"


@pytest.fixture(scope="module")
def rubbing():
    """A jaw with dry friction, and its base model."""
    loaded = jaw_with(FRICTION, force_n=0.08)
    return loaded, *fit_model(loaded, 0, silent)


def tied(rubbing, *names: str) -> tuple:
    """A study, a step in which these could not be told apart, one that found a lag besides, and the fit with both."""
    study, last, fit = step_with(rubbing, names[0], LAG)
    (found,) = last.candidates
    settings = [EffectSetting.typical(effect_of(name, rubbing[0].gripper)) for name in names]
    candidates = [
        dataclasses.replace(found, setting=setting, signature=np.eye(len(names))[i])
        for i, setting in enumerate(settings)
    ]
    return study, [Step(names, tuple(candidates), (), 9.0, 5.0), last], fit


def names_in(fit) -> set[str]:
    return {one.effect.name for one in fit.problem.effects}


def test_a_rival_that_the_whole_model_rejects_goes(rubbing):
    study, steps, fit = tied(rubbing, FRICTION, DEADBAND)
    left, same = ask_again(study, steps, fit)
    assert [step.effects for step in left] == [(FRICTION,), (LAG,)]
    assert same is fit
    assert left[1].error_after == pytest.approx(study.error(study.heldout(fit)))


def test_a_rival_that_does_better_takes_the_place(rubbing):
    study, steps, fit = tied(rubbing, DEADBAND, FRICTION)
    left, better = ask_again(study, steps, fit)
    assert [step.effects for step in left] == [(FRICTION,), (LAG,)]
    assert names_in(better) == {FRICTION, LAG}
    assert better.cost < 0.9 * fit.cost
    assert left[0].candidates[0].effect.name == FRICTION
    assert left[1].error_after == pytest.approx(study.error(study.heldout(better)))


def test_what_the_whole_model_can_not_tell_apart_stays_tied(rubbing):
    study, steps, fit = tied(rubbing, FRICTION, "presliding")
    left, same = ask_again(study, steps, fit)
    assert left == steps
    assert same is fit


def test_of_the_last_step_all_was_in_the_model(rubbing, monkeypatch):
    study, steps, fit = tied(rubbing, FRICTION, DEADBAND)
    monkeypatch.setattr("forcegrasp.diagnosis.ask_again._asked", lambda *_: pytest.fail("asked again"))
    alone = [dataclasses.replace(steps[0], effects=(FRICTION,)), dataclasses.replace(steps[1], effects=(LAG, DEADBAND))]
    assert ask_again(study, alone, fit) == (alone, fit)
