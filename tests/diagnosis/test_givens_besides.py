"""Radii that are seen to be wrong once an effect is known that had hidden it."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

from forcegrasp.diagnosis.diagnose_set import diagnose_set
from forcegrasp.diagnosis.givens import givens_besides
from forcegrasp.diagnosis.result import Diagnosis
from forcegrasp.effects import get_effect
from forcegrasp.effects.setting import EffectSetting
from forcegrasp.identify.fitted_model import model_of
from forcegrasp.identify.loading import Loaded
from forcegrasp.reports.diagnosis_answer import answer
from tests.light_set import light_set

OFF_M = {"thing_0": 6e-4, "thing_1": -5e-4}


def silent(text: str) -> None:
    """Takes what a diagnosis tells about its progress."""


def limited() -> Loaded:
    """Grasps by motors that give little, of objects of which a ruler gave the radii: one too large, one too small."""
    loaded = light_set("force_limit")
    grasps = [dataclasses.replace(g, radius_m=g.radius_m + OFF_M.get(g.object, 0.0)) for g in loaded.measured.grasps]
    return dataclasses.replace(loaded, measured=dataclasses.replace(loaded.measured, grasps=tuple(grasps)))


@pytest.fixture(scope="module")
def diagnosis() -> Diagnosis:
    return diagnose_set(limited(), None, ["force_limit"], 0, silent)[0]


def test_radii_are_put_right_beside_the_effect_that_had_hidden_them(diagnosis):
    assert (diagnosis.verdict, diagnosis.effects) == ("effect", ("object_radius", "force_limit"))
    assert diagnosis.error_before > 20
    assert diagnosis.error_after < 1.03
    assert not diagnosis.left
    truth = {g.object: g.radius_m for g in light_set("force_limit").measured.grasps}
    fitted = dict(zip((entry.name for entry in diagnosis.fit.problem.entries), diagnosis.fit.values, strict=True))
    for name, off in OFF_M.items():
        assert fitted[f"radius_m of {name}"] == pytest.approx(truth[name], abs=1e-4)
        told = f"the radius of {name} is {1e3 * truth[name]:.1f} mm, the set says {1e3 * (truth[name] + off):.1f} mm"
        assert told in answer(diagnosis)


def test_radii_are_not_doubted_where_little_is_left_or_what_was_found_is_tied(diagnosis, monkeypatch):
    asked = []
    monkeypatch.setattr(givens_besides, "suspects", lambda *_: asked.append(1) or [])
    step = diagnosis.steps[0]
    found = dataclasses.replace(diagnosis, fault=None, left="much", error_after=2.0, steps=(step,))
    tied = dataclasses.replace(step, effects=(*step.effects, "rate_limit"))
    for other, doubted in (
        (found, True),
        (dataclasses.replace(found, left=""), False),
        (dataclasses.replace(found, error_after=1.3), False),
        (dataclasses.replace(found, steps=(tied,)), False),
        (dataclasses.replace(found, fault=diagnosis.fault), False),
        (dataclasses.replace(found, stopped="time"), False),
    ):
        asked.clear()
        assert givens_besides.with_givens_put_right(other, limited(), None, None, silent) is None  # pyright: ignore
        assert bool(asked) == doubted


def test_radii_that_are_fitted_begin_where_a_linear_step_leads(diagnosis):
    fitted = {"radius_m of thing_0": 0.018, "radius_m of thing_1": 0.02, "load_kg of log": 0.1}
    moves = {"radius_m of thing_0": 0.001, "offset_m of g000": 0.002}
    fault = dataclasses.replace(diagnosis.fault, fitted=fitted, moves=moves)
    known = model_of(diagnosis.fit, diagnosis.target, limited(), ())
    begun = fault.begun_from(known)
    assert begun.objects["thing_0"]["radius_m"].value == pytest.approx(0.019)
    assert set(begun.objects["thing_0"]) == {*known.objects["thing_0"], "radius_m"}
    assert begun.objects["thing_1"].keys() == known.objects["thing_1"].keys()  # no step says where
    assert set(begun.objects) == set(known.objects)


@pytest.fixture
def with_rivals(made_up):
    """A diagnosis of one step whose effect has rivals: of as much, of less, a mistake of the set, and a second one."""
    found = made_up.diagnosis("one_of")
    (step, *_) = found.steps
    bias, drift = step.candidates

    def rival(share: float, **changed):
        gains = np.full_like(bias.gains, share * bias.heldout_gain / len(bias.gains))
        setting = dataclasses.replace(drift.setting, values=np.full(len(drift.setting.values), share))
        return dataclasses.replace(drift, gains=gains, **({"setting": setting} | changed))

    of_set = rival(0.95, setting=EffectSetting.typical(get_effect("object_size"), ""))
    step = dataclasses.replace(
        step, effects=step.effects[:1], candidates=(bias, rival(0.7), of_set, rival(0.9), rival(0.85), rival(0.99))
    )
    return dataclasses.replace(found, fault=None, left="much", error_after=3.0, steps=(step,), fit=bias.fit)


def test_rivals_that_explained_nearly_as_much_are_tried_with_the_set_put_right(with_rivals, monkeypatch):
    asked, fits = [], []

    def refit_as(setting, fit, name, study):
        asked.append((setting.values[0], name))
        fits.append(dataclasses.replace(with_rivals.steps[0].candidates[1].fit))
        return fits[-1]

    monkeypatch.setattr(givens_besides, "refit_as", refit_as)
    models = list(givens_besides._near_models(with_rivals, with_rivals.steps, silent))
    assert asked == [(0.9, "force_bias"), (0.85, "force_bias")]  # of three that are near enough
    assert [fit for fit, _ in models] == [with_rivals.fit, *fits]
    assert [steps[0].effects for _, steps in models] == [("force_bias",), ("force_drift",), ("force_drift",)]
    for fit, (step,) in models[1:]:
        assert step.candidates[0].fit is fit


@pytest.mark.parametrize("rival_is_better", [False, True])
def test_what_leaves_less_once_the_set_is_put_right_is_gone_on_with(with_rivals, monkeypatch, rival_is_better):
    first, other = with_rivals.fit, with_rivals.steps[0].candidates[1].fit
    models = [(first, [with_rivals.steps[0]]), (other, [with_rivals.steps[0]])]
    monkeypatch.setattr(givens_besides, "_near_models", lambda *_: iter(models))
    fault = SimpleNamespace(fitted={"radius_m of a": 0.01}, is_borne_out=lambda fit: True, told_by=lambda fit: None)
    monkeypatch.setattr(givens_besides, "suspects", lambda *_: [fault])
    for name in ("beyond_fit", "Study", "with_few", "evidence_folds"):
        monkeypatch.setattr(givens_besides, name, lambda *_: None)
    monkeypatch.setattr(givens_besides, "one_after_the_other", lambda study, steps, fit: (steps, fit))
    monkeypatch.setattr(givens_besides, "with_fault", lambda again, *_: again)

    def put_right(fault, said):
        size = 0.5 if (said[2].fit is other) == rival_is_better else 1.0
        fit = dataclasses.replace(said[2].fit, residual=size * first.residual)
        return fault, (said[0], said[1], dataclasses.replace(said[2], fit=fit))

    def search_on(target, simulators, base, fit, steps):
        return SimpleNamespace(fit=fit)

    again, _ = givens_besides.with_givens_put_right(with_rivals, limited(), put_right, search_on, silent)
    assert again.fit.problem is (other if rival_is_better else first).problem
