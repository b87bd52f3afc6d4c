"""Rows that are read earlier or later than their time stamps say."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from forcegrasp.diagnosis.noise import clock_jitter as module
from forcegrasp.diagnosis.noise.clock_jitter import ClockJitter, clock_jitter
from forcegrasp.identify.fit import Fit
from forcegrasp.identify.fit_set import fit_model
from forcegrasp.identify.progress import silent
from forcegrasp.identify.target import Target
from forcegrasp.reports.diagnosis import diagnosis_json
from forcegrasp.reports.diagnosis_words import left_sentence
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
    found = clock_jitter(read_late(target, fit, late_s), target, fit)
    assert found is not None
    assert found.std_s == pytest.approx(std_s, rel=0.15)
    assert 0.7 < found.share <= 1.0


def test_nothing_else_is_taken_for_it(fitted):
    target, fit = fitted
    shape, rng = target.mask.shape, np.random.default_rng(0)
    assert clock_jitter(fit.residual, target, fit) is None
    assert clock_jitter(read_late(target, fit, np.full((*shape, 1), 0.003)), target, fit) is None  # all alike
    assert clock_jitter(read_late(target, fit, 0.002 * rng.standard_normal((*shape, 4))), target, fit) is None
    assert clock_jitter(fit.residual + rng.standard_normal((*shape, 4)), target, fit) is None
    late_s = 0.0005 * rng.standard_normal((*shape, 1))
    noisy = read_late(target, fit, late_s) + 2 * rng.standard_normal((*shape, 4))
    assert clock_jitter(noisy, target, fit) is None  # it is there, and makes little of what positions leave


def test_it_is_told_and_what_to_do(made_up, monkeypatch):
    found = made_up.diagnosis("effect")
    told = "rows are read 1.2 ms earlier or later than their time stamps say (standard deviation), which makes 60% of"
    for left in ("", "1.2 × noise in all"):
        diagnosis = dataclasses.replace(found, left=left)
        for uneven in (False, True):
            monkeypatch.setitem(vars(diagnosis), "is_uneven_noise", uneven)
            monkeypatch.setitem(vars(diagnosis), "clock_jitter", ClockJitter(0.0012, 0.6))
            assert told in left_sentence(diagnosis)
            assert "twice" not in left_sentence(diagnosis)
            assert diagnosis_json(diagnosis, None, [], "set")["clock_jitter"] == {"std_s": 0.0012, "share": 0.6}
            monkeypatch.setitem(vars(diagnosis), "clock_jitter", None)
            assert "stamp" not in left_sentence(diagnosis)
            assert ("twice" in left_sentence(diagnosis)) == bool(left and uneven)
            assert diagnosis_json(diagnosis, None, [], "set")["clock_jitter"] is None


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
