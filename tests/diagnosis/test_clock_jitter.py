"""Rows that are read earlier or later than their time stamps say."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from forcegrasp.diagnosis.noise import clock_jitter as module
from forcegrasp.diagnosis.noise.clock_jitter import ClockJitter, clock_jitter
from forcegrasp.diagnosis.noise.noise_check import Noise
from forcegrasp.identify.fit import Fit
from forcegrasp.identify.fit_set import fit_model
from forcegrasp.identify.progress import silent
from forcegrasp.identify.target import Target
from forcegrasp.reports.diagnosis import lines
from forcegrasp.reports.diagnosis_as_json import diagnosis_json
from forcegrasp.reports.diagnosis_box import answer_box
from forcegrasp.reports.diagnosis_words import left_sentence, noise_words
from forcegrasp.reports.next_step import after_diagnosis
from tests.light_set import light_set


@pytest.fixture(scope="module")
def fitted() -> tuple[Target, Fit]:
    """Two dozen grasps with nothing hidden, and the base model."""
    target, _, base = fit_model(light_set(grasps=24), 0, silent)
    return target, base.fit


def read_late(target: Target, fit: Fit, late_s: np.ndarray) -> np.ndarray:
    """What the fit leaves, as if rows, or each reading of them, were read so much later, ``(G, S, C)``."""
    return fit.residual + module._speeds(target, fit) * late_s / module._LATER_S


@pytest.mark.parametrize("std_s", [0.001, 0.002])
def test_the_scatter_of_rows_is_measured(fitted, std_s):
    target, fit = fitted
    late_s = std_s * np.random.default_rng(0).standard_normal((*target.mask.shape, 1))
    left = read_late(target, fit, late_s)
    found = clock_jitter(left, target, fit)
    assert found is not None
    assert found.std_s == pytest.approx(std_s, rel=0.15)
    of_late = np.mean((left - fit.residual)[..., :2][target.mask] ** 2)
    beyond_noise = np.mean(left[..., :2][target.mask] ** 2) - 1
    assert found.share == pytest.approx(min(1.0, of_late / beyond_noise), rel=0.3)


def test_nothing_else_is_taken_for_it(fitted):
    target, fit = fitted
    shape, rng = target.mask.shape, np.random.default_rng(0)
    assert clock_jitter(fit.residual, target, fit) is None
    assert clock_jitter(read_late(target, fit, np.full((*shape, 1), 0.003)), target, fit) is None  # all alike
    assert clock_jitter(read_late(target, fit, 0.002 * rng.standard_normal((*shape, 4))), target, fit) is None
    assert clock_jitter(fit.residual + rng.standard_normal((*shape, 4)), target, fit) is None
    shared = np.array([1.0, 1, 0, 0]) * rng.standard_normal((*shape, 1))
    assert clock_jitter(fit.residual + shared, target, fit) is None
    late_s = 0.0005 * rng.standard_normal((*shape, 1))
    noisy = read_late(target, fit, late_s) + 2 * rng.standard_normal((*shape, 4))
    assert clock_jitter(noisy, target, fit) is None  # it is there, and makes little of what positions leave


@pytest.mark.parametrize("verdict", ["effect", "explained", "unknown"])
def test_it_is_told_whatever_the_verdict_and_in_place_of_larger_noise(made_up, monkeypatch, verdict):
    noise = Noise(np.full(4, 1.2), np.ones(4), np.ones(4, bool), np.zeros(4), np.zeros(4))
    told = "rows are read 1.2 ms earlier or later than their time stamps say (standard deviation), which makes 60% of"
    for jitter in (None, ClockJitter(0.0012, 0.6)):
        diagnosis = dataclasses.replace(made_up.diagnosis(verdict), noise=noise)
        monkeypatch.setitem(vars(diagnosis), "clock_jitter", jitter)
        monkeypatch.setitem(vars(diagnosis), "is_uneven_noise", verdict == "unknown")
        is_told = jitter is not None
        assert any(told in line for line in lines(diagnosis, None)) is is_told
        assert ("Time stamps" in str(answer_box(diagnosis, None, []))) is is_told
        assert ("position_std_m" in noise_words(diagnosis)) is not is_told
        assert ("twice" in left_sentence(diagnosis)) is (verdict == "unknown" and not is_told)
        again = [command.purpose for command in after_diagnosis(diagnosis, None, "set", "base.yaml", "model.yaml")]
        assert ("give the noise as it is, and diagnose again" in again) is (verdict == "explained" and not is_told)
        said = diagnosis_json(diagnosis, None, [], "set")["clock_jitter"]
        assert said == ({"std_s": 0.0012, "share": 0.6} if is_told else None)


def test_a_model_that_lacks_much_foretells_no_single_row(made_up, monkeypatch):
    asked = []
    monkeypatch.setattr("forcegrasp.diagnosis.result.clock_jitter", lambda *_: asked.append(1))
    found = made_up.diagnosis("effect")
    numerical = (np.zeros_like(found.fit.residual),) * 2
    for error, looked in ((1.6, 0), (1.4, 1)):
        diagnosis = dataclasses.replace(found, error_after=error, floor=1.0, numerical=numerical)
        assert diagnosis.clock_jitter is None
        assert len(asked) == looked
    assert dataclasses.replace(found, error_after=1.0, floor=1.0, numerical=()).clock_jitter is None
    assert len(asked) == 1
