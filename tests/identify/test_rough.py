"""Where no fit converges, larger steps for slopes are tried, and kept if they lead further; then shorter ways."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from forcegrasp.identify import base_fit
from forcegrasp.identify.base_fit import BaseFit, fit_base
from forcegrasp.identify.simulators import LARGE_STEP, STEP


def _first_ends_at(monkeypatch, made_up, begun, **values: Any) -> None:
    """Every start ends at one fit, whose slopes have not vanished."""
    end = SimpleNamespace(vector=begun.vector, cost=begun.cost, error=1.0)
    small = SimpleNamespace(known=None, cost=begun.cost, fit=lambda start: end, problem=None, target=made_up.target)
    for name, value in {
        "fit_once": lambda *a: begun,
        "guess": lambda *a: None,
        "Subset": lambda *a: small,
        "_random_start": lambda *a: None,
        "check_gradient": lambda fit, target, errors=(): BaseFit(fit, errors, False, "rough"),
        **values,
    }.items():
        monkeypatch.setattr(base_fit, name, value)


@pytest.mark.parametrize("hasty", [False, True])
@pytest.mark.parametrize("error", [1.4, 1.6])
def test_in_haste_a_fit_that_leaves_much_more_than_noise_is_left_before_its_end(made_up, monkeypatch, hasty, error):
    begun, asked = made_up.base.fit, []

    def finished(base, target, simulators):
        asked.append(base.fit)
        return base

    _first_ends_at(monkeypatch, made_up, begun, finished=finished, rms_error=lambda *_: error)
    simulators = SimpleNamespace(step=STEP, one_model=True)
    base = fit_base(made_up.target, begun.problem, cast(Any, simulators), np.random.default_rng(0), hasty=hasty)
    left = hasty and error > 1.5
    assert (base.unfinished, base.converged) == (left, False)
    assert asked == ([] if left else [begun])


@pytest.mark.parametrize(("left", "kept"), [(0.7, LARGE_STEP), (1.0, STEP)])
@pytest.mark.parametrize(("patience", "settled", "rounds"), [(1.0, True, 1), (0.9, False, 3)])
def test_larger_steps_are_kept_where_they_lead_further(made_up, monkeypatch, left, kept, patience, settled, rounds):
    """``left`` of the residuals by larger steps, ``patience`` by each patient fit from where that ended."""
    begun = made_up.base.fit
    steps, last = [], begun

    def fit_exactly(target, problem, simulators, start, patient=False):
        nonlocal last
        steps.append((simulators.step, patient))
        share = patience if patient else left if simulators.step == LARGE_STEP else 1.0
        before = last if patient else begun
        found = dataclasses.replace(before, residual=share * before.residual)
        last = found if found.cost < last.cost else last
        return found

    _first_ends_at(monkeypatch, made_up, begun, fit_exactly=fit_exactly)
    simulators = SimpleNamespace(step=STEP, one_model=True)
    base = fit_base(made_up.target, begun.problem, cast(Any, simulators), np.random.default_rng(0))
    assert steps == [(STEP, False), (LARGE_STEP, False), *rounds * [(kept, True)]]
    assert simulators.step == kept
    assert base.fit.cost == pytest.approx((min(left, 1.0) * patience**rounds) ** 2 * begun.cost)
    assert (base.settled, base.converged) == (settled, False)
    assert base.reason.startswith("no step lowers the error" if settled else "rough")
