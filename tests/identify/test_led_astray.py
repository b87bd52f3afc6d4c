"""Grasps that hold a fit back are left out until the others know the way."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from forcegrasp.identify import led_astray
from forcegrasp.identify.fit import Fit
from forcegrasp.identify.led_astray import fit_led_by_others
from forcegrasp.identify.simulators import Simulators


@pytest.fixture
def led(made_up, monkeypatch):
    """``led(fit, missed)``: the function, where all grasps are missed by so many σ from where the others lead; and of
    how many grasps fits were asked for, each of which leaves nothing."""

    def run(fit: Fit, missed: float) -> tuple[Fit, list[int]]:
        asked: list[int] = []

        def fit_exactly(target, problem, simulators, start, slopes) -> Fit:
            asked.append(len(target.grasps))
            alike = made_up.base.fit.subset(np.arange(len(target.grasps)))
            return dataclasses.replace(alike, problem=problem, vector=start, residual=0 * alike.residual)

        monkeypatch.setattr(led_astray, "fit_exactly", fit_exactly)
        off = made_up.target.signals + missed * made_up.target.sigma
        monkeypatch.setattr(led_astray, "predict", lambda *_: [off])
        return fit_led_by_others(fit, made_up.target, Simulators(fit.problem)), asked

    return run


def leaving(made_up, per_grasp: np.ndarray) -> Fit:
    """The base fit with residuals of these sizes ÷ noise, ``(G,)``."""
    residual = np.where(made_up.target.mask[..., None], per_grasp[:, None, None], 0.0)
    return dataclasses.replace(made_up.base.fit, residual=np.broadcast_to(residual, made_up.base.fit.residual.shape))


@pytest.mark.parametrize(("missed", "fitted"), [(1.0, [7, 8]), (90.0, [7])])
def test_where_one_grasp_holds_most_of_the_error_the_others_come_first(made_up, led, missed, fitted):
    """And all of them after it, if the others lead to anything better."""
    astray = leaving(made_up, np.where(np.arange(8) == 1, 50.0, 1.0))
    fit, asked = led(astray, missed)
    assert asked == fitted
    assert fit.cost == (0.0 if len(fitted) == 2 else astray.cost)


def test_where_one_object_holds_most_of_the_error_the_others_come_first(made_up, led):
    objects = np.array([grasp.object for grasp in made_up.target.grasps])
    own = objects == objects[-1]
    assert 2 < own.sum() < len(own)
    fit, asked = led(leaving(made_up, np.where(own, 20.0, 1.0)), 1.0)
    assert asked == [len(own) - own.sum(), len(own)]
    assert fit.cost == 0


def test_where_all_grasps_hold_some_none_is_left_out(made_up, led):
    alike = leaving(made_up, np.full(8, 50.0))
    assert led(alike, 0.0) == (alike, [])


def test_where_a_third_of_the_grasps_holds_most_of_the_error_the_others_come_first(made_up, led):
    """One of each object here."""
    fit, asked = led(leaving(made_up, np.where(np.isin(np.arange(8), [0, 1]), 20.0, 4.0)), 1.0)
    assert asked == [6, 8]
    assert fit.cost == 0
