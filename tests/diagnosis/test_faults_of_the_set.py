"""What the set says may be wrong, and not the model: found, told, and no effect made up for it."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from forcegrasp.diagnosis.diagnose_set import diagnose_set
from forcegrasp.diagnosis.odd_grasps import odd_grasps
from forcegrasp.identify.fit_set import apply_model, fit_model
from forcegrasp.identify.fitted_model import model_of
from forcegrasp.identify.loading import Loaded, load
from forcegrasp.models.model_file import Model
from forcegrasp.reports.diagnosis import answer
from tests.independent.rig import record

pytestmark = pytest.mark.xdist_group("one fit for all")


def silent(text: str) -> None:
    """Takes what a diagnosis tells about its progress."""


@pytest.fixture(scope="module")
def sound(tmp_path_factory) -> tuple[Loaded, Model]:
    """Nine grasps of three objects, with nothing hidden, and the base model of them."""
    folder = tmp_path_factory.mktemp("sound") / "set"
    record(folder, {}, 2, 9, samples=80)
    loaded = load(folder)
    target, _, base = fit_model(loaded, 0, silent)
    assert odd_grasps(target, base.fit) == ()
    everywhere = dataclasses.replace(base.fit, residual=np.where(target.mask[..., None], 9.0, 0.0))
    assert odd_grasps(target, everywhere) == ()
    return loaded, model_of(base.fit, target, loaded, [])


def changed(loaded: Loaded, change) -> Loaded:
    """The set with each grasp changed by a function."""
    grasps = tuple(change(g) for g in loaded.measured.grasps)
    return dataclasses.replace(loaded, measured=dataclasses.replace(loaded.measured, grasps=grasps))


def test_a_wrong_radius_is_found(sound):
    loaded, model = sound
    wrong = changed(loaded, lambda g: dataclasses.replace(g, radius_m=g.radius_m + 0.0005))
    diagnosis, _ = diagnose_set(wrong, model, ["object_size"], 0, silent)
    assert (diagnosis.verdict, diagnosis.effects) == ("data", ("object_size",))
    assert diagnosis.fit.values[-1] == pytest.approx(-0.0005, abs=0.0001)


def test_swapped_force_columns_are_told(sound):
    loaded, model = sound
    swapped = changed(loaded, lambda g: dataclasses.replace(g, force_n=g.force_n[:, ::-1]))
    diagnosis, _ = diagnose_set(swapped, model, ["swapped_forces"], 0, silent)
    assert (diagnosis.verdict, diagnosis.effects) == ("data", ("swapped_forces",))
    assert "press on one finger by hand" in answer(diagnosis)


def test_swapped_labels_are_told_and_nothing_else_is_looked_for(sound):
    loaded, model = sound
    one = loaded.measured.grasps[0]
    other = next(g for g in loaded.measured.grasps if g.object != one.object)
    swap = {one.name: other, other.name: one}

    def relabel(g):
        return dataclasses.replace(g, object=swap[g.name].object, radius_m=swap[g.name].radius_m)

    swapped = changed(loaded, lambda g: relabel(g) if g.name in swap else g)
    diagnosis, _ = diagnose_set(swapped, model, [], 0, silent)
    assert (diagnosis.verdict, diagnosis.effects, diagnosis.steps) == ("data", ("object_labels",), ())
    told = {(g.name, g.object, g.like) for g in diagnosis.odd}
    assert told == {(one.name, other.object, one.object), (other.name, one.object, other.object)}
    assert all(g.error > 4 and g.error_like < 2 for g in diagnosis.odd)
    assert f"grasp {one.name} of {other.object}" in answer(diagnosis)


def test_a_grasp_that_fits_no_object_is_told_and_does_not_decide(sound):
    loaded, model = sound
    name = loaded.measured.grasps[0].name
    backwards = changed(
        loaded, lambda g: dataclasses.replace(g, force_n=g.force_n[::-1].copy()) if g.name == name else g
    )
    target, _, base = apply_model(backwards, model, silent, refit=True)
    (odd,) = odd_grasps(target, base.fit)
    assert (odd.name, odd.like) == (name, "")
