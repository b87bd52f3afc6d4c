"""Radii that are seen to be wrong once an effect is known that had hidden it."""

from __future__ import annotations

import dataclasses

import pytest

from forcegrasp.diagnosis.diagnose_set import diagnose_set
from forcegrasp.diagnosis.givens import givens_besides
from forcegrasp.diagnosis.result import Diagnosis
from forcegrasp.identify.fitted_model import model_of
from forcegrasp.identify.loading import Loaded
from forcegrasp.reports.diagnosis import answer
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
