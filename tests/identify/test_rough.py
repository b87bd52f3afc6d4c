"""Where no fit converges, slopes over larger steps are tried, and kept if they lead further."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from forcegrasp.identify import base_fit
from forcegrasp.identify.base_fit import BaseFit, fit_base
from forcegrasp.identify.simulators import LARGE_STEP, STEP


@pytest.mark.parametrize(("left", "kept"), [(0.7, LARGE_STEP), (1.0, STEP)])
def test_larger_steps_are_kept_where_they_lead_further(made_up, monkeypatch, left, kept):
    fit = made_up.base.fit
    steps = []

    def fit_exactly(target, problem, simulators, start):
        steps.append(simulators.step)
        share = left if simulators.step == LARGE_STEP else 1.0
        return dataclasses.replace(fit, residual=share * fit.residual)

    end = SimpleNamespace(vector=fit.vector, cost=fit.cost, error=1.0)
    small = SimpleNamespace(known=None, cost=fit.cost, fit=lambda start: end, problem=None, target=made_up.target)
    for name, value in {
        "fit_once": lambda *a: fit,
        "fit_exactly": fit_exactly,
        "guess": lambda *a: None,
        "Subset": lambda *a: small,
        "_random_start": lambda *a: None,
        "check_gradient": lambda fit, target, errors=(): BaseFit(fit, errors, False, "rough"),
    }.items():
        monkeypatch.setattr(base_fit, name, value)
    simulators = SimpleNamespace(step=STEP, one_model=True)
    base = fit_base(made_up.target, fit.problem, cast(Any, simulators), np.random.default_rng(0))
    assert steps == [STEP, LARGE_STEP]
    assert simulators.step == kept
    assert base.fit.cost == pytest.approx(min(left, 1.0) ** 2 * fit.cost)
