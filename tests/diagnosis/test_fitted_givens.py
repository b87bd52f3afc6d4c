"""Radii and places are fitted within their tolerance beside the effects, where they are a little off."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from forcegrasp.diagnosis import diagnose_set as diagnose_set_module
from forcegrasp.diagnosis import set_search
from forcegrasp.diagnosis.diagnose_set import _put_right_or_as_said, diagnose_set
from forcegrasp.diagnosis.faults.fault import Fault
from forcegrasp.diagnosis.faults.tolerance import all_radii
from forcegrasp.diagnosis.faults.wrong_radii import moved_as_fault
from forcegrasp.diagnosis.givens import fitted_givens
from forcegrasp.diagnosis.givens.fitted_givens import told_as_moved, with_fitted_givens
from forcegrasp.diagnosis.set_search import SetSearch
from forcegrasp.effects.for_gripper import effect_of
from forcegrasp.effects.setting import EffectSetting
from forcegrasp.identify.cross_validation import make_folds
from forcegrasp.identify.fit_set import fit_model
from forcegrasp.identify.loading import Loaded
from forcegrasp.identify.problem import Problem
from forcegrasp.identify.progress import silent
from forcegrasp.identify.verdict import Verdict
from forcegrasp.measure import MeasurementSet
from forcegrasp.reports.diagnosis_words import fault_words
from tests.light_set import light_set

RULER_M, CALLIPER_M, BY_HAND_M = 3e-4, 5e-5, 4e-4


def said_otherwise(loaded: Loaded[MeasurementSet], radii_m: float, places_m: float) -> Loaded[MeasurementSet]:
    """A set whose radii and places are off by so much, standard deviations, and which says so of the radii."""
    rng, measured = np.random.default_rng(5), loaded.measured
    off = {name: radii_m * rng.standard_normal() for name in dict.fromkeys(g.object for g in measured.grasps)}
    grasps = tuple(
        dataclasses.replace(
            g, radius_m=g.radius_m + off[g.object], offset_m=g.offset_m + places_m * rng.standard_normal()
        )
        for g in measured.grasps
    )
    return dataclasses.replace(loaded, measured=dataclasses.replace(measured, grasps=grasps, radius_std_m=RULER_M))


@pytest.fixture(scope="module")
def truly():
    return light_set("force_lag time_constant_s=0.08", grasps=9, samples=54)


@pytest.fixture(scope="module")
def off(truly):
    return said_otherwise(truly, RULER_M, BY_HAND_M)


@pytest.fixture(scope="module")
def said(off):
    return fit_model(off, 0, silent, hasty=True)


@pytest.fixture(scope="module")
def fitted(off, said):
    return with_fitted_givens(off, said, silent)


def test_they_leave_less_than_as_they_are_said(off, said, fitted):
    loaded, (target, _, base) = fitted
    assert base.fit.cost < said[2].fit.cost - 100
    priors = base.fit.problem.priors
    assert len(priors) == len(off.measured.grasps) + len(target.objects)
    assert priors.cost(base.fit.vector) < 3 * len(priors)
    assert all(grasp.fitted_m == (RULER_M, off.measured.offset_std_m) for grasp in loaded.measured.grasps)


def test_they_stay_as_said_where_nothing_is_left():
    loaded = light_set(grasps=6, samples=40)
    assert with_fitted_givens(loaded, fit_model(loaded, 0, silent), silent) is None


def test_they_stay_as_said_where_that_would_take_more_than_their_tolerance(truly):
    wrong = said_otherwise(truly, 8 * RULER_M, BY_HAND_M)
    assert with_fitted_givens(wrong, fit_model(wrong, 0, silent, hasty=True), silent) is None


def test_they_stay_as_said_if_that_does_as_well(off, said, monkeypatch):
    monkeypatch.setattr(fitted_givens, "_CHANCE", 0.0)
    assert with_fitted_givens(off, said, silent) is None


@pytest.fixture(scope="module")
def found(fitted):
    """Where no effect is known."""
    _, given = fitted
    return SetSearch(None, [], 0, silent).search(*given)


def test_where_they_were_put_is_told(off, said, found):
    told = told_as_moved(found, off, said)
    assert told is not None
    assert told.fault is not None
    assert told.fault.name == "object_tolerance"
    assert "radius of" in told.fault.words
    assert told.fault.moved is not None
    of_fit = {e.name: v - e.start for e, v in zip(found.fit.problem.entries, found.fit.values, strict=True)}
    name = off.measured.grasps[0].object
    assert told.fault.moved.moves[f"radius_m of {name}"] == pytest.approx(of_fit[f"radius_m of {name}"])
    assert told.error_before > told.error_moved == found.error_before


def test_what_makes_no_difference_is_taken_as_it_is_given(off, said, found, monkeypatch):
    """Alone, and beside an effect, which is fitted to the set as it is."""
    monkeypatch.setattr(fitted_givens, "_CHANCE", 0.0)
    alone = told_as_moved(found, off, said)
    assert alone is not None
    assert alone.fault is None
    assert alone.fit is alone.base.fit
    assert alone.fit.cost < 1.001 * said[2].fit.cost
    assert not any(alone.target.grasps[0].fitted_m)
    lag = EffectSetting.typical(effect_of("force_lag", off.gripper))
    problem = Problem(off.gripper, found.target.grasps, [lag])
    vector = np.r_[found.fit.vector, problem.start()[len(found.fit.vector) :]]
    jacobian = np.pad(found.fit.jacobian, [(0, 0)] * 3 + [(0, 1)])
    fit = dataclasses.replace(found.fit, problem=problem, vector=vector, jacobian=jacobian)
    beside = told_as_moved(dataclasses.replace(found, fit=fit, verdict=Verdict.EFFECT), off, said)
    assert beside is not None
    assert not len(beside.fit.problem.priors)
    assert beside.fit.effect("force_lag").values[0] == pytest.approx(0.08, rel=0.2)
    assert beside.error_after < alone.error_after


def test_without_grasps_that_were_left_out_the_base_model_is_of_the_others(off, said, found):
    rest = np.arange(1, len(found.target.grasps))
    few = dataclasses.replace(found, target=found.target.subset(rest), fit=found.fit.subset(rest))
    base, folds = dataclasses.replace(found.base, fit=few.fit), tuple(make_folds(few.target.grasps))
    few = dataclasses.replace(few, base=base, folds=folds, verdict=Verdict.EFFECT)
    told = told_as_moved(few, off, said)
    assert told is not None
    assert told.base is few.base
    assert told.error_before == told.error_moved == few.error_before


def test_that_they_show_only_beside_what_is_missing_is_told_as_that(off, said, found, monkeypatch):
    monkeypatch.setattr(fitted_givens, "_AT_ONCE", 1.0)
    told = told_as_moved(found, off, said)
    assert told is not None
    assert told.error_before == told.error_moved == found.error_before


def test_what_is_put_beyond_its_tolerance_is_another_matter(off, said, found):
    priors = found.fit.problem.priors
    far = found.fit.vector + 9 * np.where(priors.precision > 0, 1 / np.maximum(priors.precision, 1e-9), 0.0)
    beyond = dataclasses.replace(found, fit=dataclasses.replace(found.fit, vector=far))
    assert told_as_moved(beyond, off, said) is None
    cut_short = told_as_moved(dataclasses.replace(beyond, stopped="its 3 min were over"), off, said)
    assert cut_short is not None
    assert "by more than its tolerance" in fault_words(cut_short)  # there is no time to look at that


@pytest.mark.parametrize(("left", "far", "told"), [("", True, True), ("much", True, False), ("", False, False)])
def test_radii_that_are_put_beyond_it_one_by_one_are_wrong_where_nothing_is_left(off, said, found, left, far, told):
    """Places that are put too far may be anything, and so may what leaves something."""
    priors, entries = found.fit.problem.priors, found.fit.problem.entries
    moves = {name: 5.0 * (-1) ** place for place, name in enumerate(found.target.objects)}
    by = [moves.get(entry.name.removeprefix("radius_m of "), 0.0 if far else 9.0) for entry in entries]
    vector = np.where(priors.precision > 0, priors.expected + by / np.maximum(priors.precision, 1e-9), found.fit.vector)
    fit = dataclasses.replace(found.fit, vector=vector)
    beyond = dataclasses.replace(found, fit=fit, left=left, verdict=Verdict.EXPLAINED)
    wrong = told_as_moved(beyond, off, said)
    assert (wrong is not None) == told
    if wrong is not None:
        assert wrong.fault is not None
        assert (wrong.verdict, wrong.effects, wrong.fault.name) == (Verdict.DATA, ("object_radius",), "object_radius")
        assert wrong.fault.words.count("the set says") == len(moves)


@pytest.mark.parametrize(
    ("kind", "by", "explained", "left", "told"),
    [
        ("offset_m", 9, 0.9, "", "What the set gives was moved by more than its tolerance: place in grasp"),
        ("offset_m", 9, 0.5, "", ""),
        ("radius_m", 9, 0.9, "much", "The set seems to be wrong: object_radius"),
        ("radius_m", 2, 0.9, "", "The set seems to be wrong: object_radius"),
        ("radius_m", 2, 0.9, "much", "What the set gives was moved by more than its tolerance: radius of thing_0"),
        ("radius_m", 9, 0.5, "much", ""),
    ],
)
def test_what_is_beyond_its_tolerance_beside_effects_that_explain_most_is_told(
    off, said, found, kind, by, explained, left, told
):
    """Radii were fitted as if a ruler had measured them, though the set says that a calliper did."""
    off = dataclasses.replace(off, measured=dataclasses.replace(off.measured, radius_std_m=5e-5))
    fit, priors = found.fit, found.fit.problem.priors
    one = next(index for index, entry in enumerate(fit.problem.entries) if entry.parameter == kind)
    vector = np.where(priors.precision > 0, priors.expected, fit.vector)
    vector[one] += by / priors.precision[one]
    after = np.sqrt((1 - explained) * (found.error_of_base**2 - found.floor**2) + found.floor**2)
    beyond = dataclasses.replace(
        found, fit=dataclasses.replace(fit, vector=vector), verdict=Verdict.EFFECT, error_after=after, left=left
    )
    moved = told_as_moved(beyond, off, said)
    assert ("" if moved is None else fault_words(moved)).startswith(told)
    assert (moved is not None) == bool(told)


@pytest.mark.long
def test_an_effect_is_found_though_every_grasp_is_a_little_off(off):
    found, _ = diagnose_set(off, None, [], 0, silent)
    assert found.verdict is Verdict.EFFECT
    assert found.effects == ("force_lag",)
    assert not found.left
    assert found.fault is not None
    assert found.fault.moved is not None
    assert "object" in found.fault.moved.groups


@pytest.mark.parametrize("within", [True, False])
def test_a_set_is_searched_as_it_is_where_nothing_fits_within_its_tolerance(
    off, said, fitted, found, within, monkeypatch
):
    asked = []
    monkeypatch.setattr(set_search, "with_fitted_givens", lambda *_: fitted)
    monkeypatch.setattr(set_search, "told_as_moved", lambda *_: found if within else None)
    monkeypatch.setattr(SetSearch, "search_as_it_is", lambda _, loaded, *__: asked.append(loaded) or (found, None))
    first, further = SetSearch(None, [], 0, silent).search_and_move(off, said)
    assert first is found
    assert asked == ([fitted[0]] if within else [fitted[0], off])
    assert (further is not None) == within
    if further is not None:
        assert further[0] is found
        assert further[1].exact.grasps == found.fit.problem.grasps


def within(loaded, said, by_stds: float) -> Fault:
    """All radii moved by so many standard deviations."""
    moved = all_radii(loaded.measured, said[0], by_stds * RULER_M)
    assert moved is not None
    return moved_as_fault(loaded, moved)


@pytest.mark.parametrize(
    ("verdict", "by_stds", "settled"),
    [
        (Verdict.EFFECT, 1.9, True),
        (Verdict.EXPLAINED, 0.1, True),
        (Verdict.EXPLAINED, 1.9, False),  # an effect may do as well as so large a move
    ],
)
def test_what_seems_moved_is_fitted_beside_effects_before_it_is_put_there(
    off, said, found, verdict, by_stds, settled, monkeypatch
):
    """Radii that stay where the base model wants them leave no room for the effect that they made up for."""
    put = []
    suspect, told = within(off, said, 1.0), within(off, said, by_stds)
    both = found, (dataclasses.replace(found, verdict=verdict, fault=told), said[1])
    monkeypatch.setattr(diagnose_set_module, "suspects", lambda *_: [suspect])
    monkeypatch.setattr(SetSearch, "search_with_givens", lambda *_: both)
    monkeypatch.setattr(SetSearch, "put_right", lambda _, fault, __: put.append(fault))
    monkeypatch.setattr(SetSearch, "search_as_it_is", lambda *_: both)
    assert _put_right_or_as_said(SetSearch(None, [], 0, silent), off, said) is both[1]
    assert put == ([] if settled else [suspect])


def test_where_the_log_tells_a_fault_what_is_given_is_fitted_in_either_set(off, said, found, monkeypatch):
    fault, searched = Fault("time_scale", "", "", off, of_log=True), []
    monkeypatch.setattr(diagnose_set_module, "suspects", lambda *_: [fault])
    monkeypatch.setattr(SetSearch, "put_right", lambda *_: (fault, said))
    monkeypatch.setattr(SetSearch, "search_and_move", lambda _, loaded, __: searched.append(loaded) or (found, None))
    monkeypatch.setattr(SetSearch, "search", lambda *_, **__: pytest.fail("searched as it is given"))
    _put_right_or_as_said(SetSearch(None, [], 0, silent), off, said)
    assert len(searched) == 2


def test_radii_that_a_ruler_seems_to_have_measured_are_fitted_as_if_it_had(truly):
    """Some are larger and some smaller; if all were smaller it might be lost motion."""

    def with_calliper(loaded: Loaded[MeasurementSet], by_m: list[float]) -> Loaded[MeasurementSet]:
        measured = loaded.measured
        names = list(dict.fromkeys(grasp.object for grasp in measured.grasps))
        grasps = tuple(
            dataclasses.replace(g, radius_m=g.radius_m + by_m[names.index(g.object)]) for g in measured.grasps
        )
        return dataclasses.replace(
            loaded, measured=dataclasses.replace(measured, grasps=grasps, radius_std_m=CALLIPER_M)
        )

    either_way = with_calliper(truly, [5e-4, -5e-4, 5e-4])
    fitted = with_fitted_givens(either_way, fit_model(either_way, 0, silent, hasty=True), silent)
    assert fitted is not None
    assert {grasp.fitted_m[0] for grasp in fitted[0].measured.grasps} == {fitted[0].measured.radius_std_m} == {RULER_M}
    larger = with_calliper(light_set(grasps=9, samples=54), [3e-4, 5e-4, 7e-4])
    assert with_fitted_givens(larger, fit_model(larger, 0, silent, hasty=True), silent) is None
    one = with_calliper(light_set(grasps=9, samples=54), [0.0, 7e-4, 0.0])
    assert with_fitted_givens(one, fit_model(one, 0, silent, hasty=True), silent) is not None
