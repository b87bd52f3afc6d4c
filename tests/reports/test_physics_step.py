"""A scene whose physics steps are too long to tell what is missing is told so, with the step that would do."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from forcegrasp.diagnosis.result import Diagnosis
from forcegrasp.identify.verdict import Verdict
from forcegrasp.reports import results
from forcegrasp.reports.diagnosis import lines
from forcegrasp.reports.diagnosis_answer import answer
from forcegrasp.reports.diagnosis_box import answer_box
from forcegrasp.reports.next_step import after_diagnosis
from forcegrasp.reports.physics_step import shorter_step, step_of_scene, warning_of_fit


def with_error_of_steps(diagnosis: Diagnosis, size: float, left: str = "in all") -> Diagnosis:
    """One whose predictions half the physics step changes by so much, ÷ noise."""
    change = size * np.random.default_rng(1).standard_normal(diagnosis.fit.residual.shape)
    return dataclasses.replace(diagnosis, numerical=(change, 0 * change), left=left)


@pytest.mark.parametrize("verdict", ["unknown", "not_fitted", "effect"])
def test_a_step_that_would_do_is_told_and_is_the_first_thing_to_do(made_up, verdict):
    diagnosis = with_error_of_steps(dataclasses.replace(made_up.diagnosis(verdict), error_after=9.0), 0.5)
    step = step_of_scene(diagnosis.target.gripper)
    assert shorter_step(diagnosis) == step / 4  # an eighth of the noise, where 0.15 will do
    told = f"timestep {step / 4:g} s"
    commands = after_diagnosis(diagnosis, None, "my_set", "known.yaml", "found.yaml")
    assert told in commands[0].purpose
    assert [line for line in lines(diagnosis, None) if line.startswith("warning: half the scene's physics step")]
    assert "Physics step" in dict(answer_box(diagnosis, None, commands).rows)
    assert ("as far as the scene's physics step lets me tell" in answer(diagnosis)) == (verdict == "unknown")


def test_steps_that_are_short_enough_are_not_spoken_of(made_up):
    unknown = made_up.diagnosis("unknown")
    assert shorter_step(with_error_of_steps(unknown, 0.3)) is None
    assert shorter_step(dataclasses.replace(unknown, left="in all")) is None, "nobody simulated with half the step"
    explained = dataclasses.replace(made_up.diagnosis("explained"), verdict=Verdict.EXPLAINED)
    assert shorter_step(with_error_of_steps(explained, 0.5, left="")) is None, "nothing is left to be told"


@pytest.mark.parametrize(("size", "told"), [(0.5, True), (0.3, False)])
def test_a_fit_that_did_not_converge_says_so_too(made_up, monkeypatch, size, told):
    diagnosis = with_error_of_steps(made_up.diagnosis("not_fitted"), size)
    monkeypatch.setattr(results, "numerical_error", lambda *_: diagnosis.numerical)
    base = dataclasses.replace(diagnosis.base, converged=False, reason="the error still falls")
    first, *others = results.base_model(base, diagnosis.target, made_up.loaded).warnings
    assert first == "the fit did not converge: the error still falls"
    step = step_of_scene(diagnosis.target.gripper) / 4
    assert any(f'<option timestep="{step:g}"/> in the scene' in line for line in others) == told
    assert bool(warning_of_fit(diagnosis.fit, diagnosis.target, diagnosis.numerical)) == told
