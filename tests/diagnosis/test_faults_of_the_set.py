"""What the set says may be wrong, and not the model: found, told, and no effect made up for it."""

from __future__ import annotations

import dataclasses
import importlib
from types import SimpleNamespace

import numpy as np
import pytest

from forcegrasp.diagnosis import set_search
from forcegrasp.diagnosis.diagnose_set import diagnose_set
from forcegrasp.diagnosis.faults import odd_grasps as odd_grasps_module
from forcegrasp.diagnosis.faults.fault import Fault
from forcegrasp.diagnosis.faults.felt_sizes import doubtful_radii
from forcegrasp.diagnosis.faults.odd_grasps import odd_grasps
from forcegrasp.diagnosis.faults.suspects import suspects
from forcegrasp.diagnosis.faults.swapped_forces import grasps_with_swapped_forces
from forcegrasp.diagnosis.faults.tolerance import move_given, wanted_moves
from forcegrasp.diagnosis.givens import doubt
from forcegrasp.diagnosis.givens.doubt import with_fault_beside
from forcegrasp.diagnosis.givens.moved_set import within_tolerance_after_all
from forcegrasp.diagnosis.result import Diagnosis
from forcegrasp.diagnosis.search.search import diagnose
from forcegrasp.diagnosis.search.stop_when import StopWhen, always
from forcegrasp.effects import get_effect
from forcegrasp.effects.for_gripper import effect_of
from forcegrasp.effects.setting import EffectSetting
from forcegrasp.identify.fit_set import apply_model, fit_model
from forcegrasp.identify.fitted_model import model_of
from forcegrasp.identify.loading import Loaded
from forcegrasp.identify.problem import Problem
from forcegrasp.identify.target import make_target
from forcegrasp.identify.verdict import Verdict
from forcegrasp.models.model_file import Model
from forcegrasp.reports.diagnosis import sections
from forcegrasp.reports.diagnosis_answer import answer
from forcegrasp.reports.diagnosis_as_json import diagnosis_json
from forcegrasp.reports.diagnosis_words import fault_words
from tests.light_set import light_set


def silent(text: str) -> None:
    """Takes what a diagnosis tells about its progress."""


def with_model(loaded: Loaded) -> tuple[Loaded, Model]:
    """A set and the base model of it."""
    target, _, base = fit_model(loaded, 0, silent)
    return loaded, model_of(base.fit, target, loaded, [])


@pytest.fixture(scope="module")
def sound() -> tuple[Loaded, Model]:
    """Nine grasps of three objects, with nothing hidden, and the base model of them."""
    return with_model(light_set())


@pytest.fixture(scope="module")
def pressed_harder() -> tuple[Loaded, Model]:
    """The same with objects whose forces are larger: enough to show by themselves that they are early."""
    return with_model(light_set(seed=15))


@pytest.fixture(scope="module")
def refitted(sound):
    """The base model fitted to the sound set again, from where it stands."""
    loaded, model = sound
    return apply_model(loaded, model, silent, refit=True)


def changed(loaded: Loaded, change) -> Loaded:
    """The set with each grasp changed by a function."""
    grasps = tuple(change(g) for g in loaded.measured.grasps)
    return dataclasses.replace(loaded, measured=dataclasses.replace(loaded.measured, grasps=grasps))


def changed_by_place(loaded: Loaded, change) -> Loaded:
    """The set with some fields of each grasp changed by a function of its place among them and of itself."""
    places = {g.name: i for i, g in enumerate(loaded.measured.grasps)}
    return changed(loaded, lambda g: dataclasses.replace(g, **change(places[g.name], g)))


def test_a_wrong_radius_is_found(sound):
    loaded, model = sound
    wrong = changed(loaded, lambda g: dataclasses.replace(g, radius_m=g.radius_m + 0.0005))
    diagnosis, _ = diagnose_set(wrong, model, ["object_size"], 0, silent)
    assert (diagnosis.verdict, diagnosis.effects) == ("data", ("object_size",))
    assert diagnosis.fit.values[-1] == pytest.approx(-0.0005, abs=0.0001)


def test_an_error_of_all_radii_within_their_tolerance_is_no_fault(sound, refitted, made_up):
    loaded, (target, _, base) = sound[0], refitted
    one = made_up.diagnosis("effect").steps[0]
    size = dataclasses.replace(one, effects=("object_size",))

    def named(move_m: float, left: str = "") -> tuple[Diagnosis, Diagnosis]:
        """Alone, and besides an effect."""
        setting = EffectSetting(get_effect("object_size"), "", np.array([move_m]))
        problem = Problem(loaded.gripper, target.grasps, [setting])
        jacobian = np.pad(base.fit.jacobian, [(0, 0)] * 3 + [(0, 1)])  # no slope tells of the size
        fit = dataclasses.replace(base.fit, problem=problem, vector=problem.start(), jacobian=jacobian)
        data = Diagnosis(Verdict.DATA, ("object_size",), (size,), base, fit, target, (), 1.2, 1.0, left=left)
        both = dataclasses.replace(data, verdict=Verdict.EFFECT, effects=("backlash", "object_size"), steps=(one, size))
        return data, both

    alone, besides = (within_tolerance_after_all(one, loaded) for one in named(8e-5))
    assert (alone.verdict, alone.effects, alone.steps) == ("explained", (), ())
    assert (besides.verdict, besides.effects, besides.steps) == ("effect", ("backlash",), (one,))
    assert "What the set gives was moved within its tolerance: all radii by +0.08 mm" in fault_words(besides)
    assert sections(alone, None, [])  # a report that names no effect beside the model that was moved
    for larger_or_not_enough in (*named(1.2e-4), *named(8e-5, left="much")):
        assert within_tolerance_after_all(larger_or_not_enough, loaded) is larger_or_not_enough


@pytest.mark.long
def test_one_wrong_radius_is_told_and_fitted(sound, refitted):
    loaded, _ = sound
    wrong = changed(loaded, lambda g: dataclasses.replace(g, radius_m=g.radius_m + 0.002 * (g.object == "thing_1")))
    diagnosis, _ = diagnose_set(wrong, None, ["backlash", "object_size"], 0, silent)
    assert (diagnosis.verdict, diagnosis.effects) == ("data", ("object_radius",))
    fitted = dict(zip((e.name for e in diagnosis.fit.problem.entries), diagnosis.fit.values, strict=True))
    (true,) = {g.radius_m for g in loaded.measured.grasps if g.object == "thing_1"}
    assert f"the radius of thing_1 is {1e3 * true:.1f} mm, the set says {1e3 * true + 2:.1f} mm" in answer(diagnosis)
    assert fitted["radius_m of thing_1"] == pytest.approx(true, abs=1e-4)
    target, _, right = refitted
    assert not doubtful_radii(target, right.fit, loaded.measured.radius_std_m)


@pytest.mark.parametrize(("after", "limited"), [(1.2, True), (2.0, False)])
def test_in_place_of_a_fault_that_leaves_next_to_nothing_an_effect_must_do_as_well_at_once(
    sound, monkeypatch, after, limited
):
    """Else each that gains anything was fitted to the end, for ten minutes, and none came near."""
    loaded, model = sound
    wrong = changed(loaded, lambda g: dataclasses.replace(g, radius_m=g.radius_m + 0.002 * (g.object == "thing_1")))
    searched, found, module = [], [], importlib.import_module("forcegrasp.diagnosis.diagnose_set")

    def with_some_left(found, fault, said):
        told = with_fault_beside(found, fault, said)
        return dataclasses.replace(told, left="something", error_before=4.0, error_after=after, floor=1.0)

    monkeypatch.setattr(module, "with_fault_beside", with_some_left)

    def searching(target, *asked):
        searched.append((target, *asked))
        if None in {g.radius_m for g in target.grasps}:
            found.append(diagnose(target, *asked))
        return found[-1]  # of the set as it says: what is found there does not matter here

    monkeypatch.setattr(set_search, "diagnose", searching)
    diagnose_set(wrong, model, ["backlash"], 0, silent)
    (right, *_, unlimited), *_, (said, *_, stop_when) = searched
    assert [None in {g.radius_m for g in target.grasps} for target in (right, said)] == [True, False]
    assert unlimited.most == np.inf
    assert stop_when.may_be_given(None, None) == limited
    assert (stop_when.most < np.inf) == limited


@pytest.mark.long
def test_the_first_effect_must_come_down_to_what_is_asked_for(sound):
    loaded, model = sound
    late = changed(loaded, lambda g: dataclasses.replace(g, command_m=np.roll(g.command_m, -1, axis=0)))
    target, simulators, base = apply_model(late, model, silent, refit=True)
    delays = [effect_of("command_delay", loaded.gripper)]
    found = [
        diagnose(target, base, simulators, delays, np.random.default_rng(0), silent, None, StopWhen(always, most=most))
        for most in (np.inf, -np.inf)
    ]
    assert [one.effects for one in found] == [("command_delay",), ()]


@pytest.mark.long
def test_radii_that_a_ruler_gave_are_doubted_where_no_effect_would_do(sound):
    loaded, model = sound
    off = {"thing_0": 12e-4, "thing_1": -9e-4, "thing_2": 0.0}
    wrong = changed(loaded, lambda g: dataclasses.replace(g, radius_m=g.radius_m + off[g.object]))
    target, _, base = apply_model(wrong, model, silent, refit=True)
    (felt,) = suspects(wrong, target, base.fit)
    fault = felt.wider
    assert fault is not None
    assert (felt.name, felt.of_most, list(felt.fitted)) == ("object_radius", False, ["radius_m of thing_1"])
    assert (fault.name, fault.of_most, sorted(fault.fitted)) == (
        "object_radius", True, ["radius_m of thing_0", "radius_m of thing_1"])  # fmt: skip
    assert "object_radius_std_m" in fault.check
    right = {g.object: g.radius_m for g in fault.put_right.measured.grasps}
    assert [right[name] is None for name in off] == [True, True, False]

    def fitted(first_m: float, second_m: float):
        """A fit that says so."""
        problem = Problem(loaded.gripper, fault.put_right.measured.grasps, [])
        values = [
            {"thing_0": first_m, "thing_1": second_m}.get(entry.name.removeprefix("radius_m of "), 0.0)
            for entry in problem.entries
        ]
        return SimpleNamespace(problem=problem, values=np.array(values))

    said = {name.removeprefix("radius_m of "): radius for name, radius in fault.fitted.items()}
    one = fitted(said["thing_0"] - 4e-4, said["thing_1"] + 1e-5)
    assert fault.is_borne_out(one)
    assert "thing_0" in fault.told_by(one).words
    assert "thing_1" not in fault.told_by(one).words
    assert not fault.is_borne_out(fitted(said["thing_0"] + 1e-5, said["thing_1"] + 1e-5))
    assert fault.is_of_few(one)
    assert not fault.is_of_few(fitted(said["thing_0"] - 4e-4, said["thing_1"] + 4e-4))  # of three

    alike = changed(loaded, lambda g: dataclasses.replace(g, radius_m=g.radius_m + 4e-4))
    target, _, base = apply_model(alike, model, silent, refit=True)
    moved = wanted_moves(alike.measured, target, base.fit)
    assert moved is not None
    assert not moved.is_within
    assert move_given(alike.measured, target, base.fit) is None
    assert moved.radii_apart() == []
    assert suspects(alike, target, base.fit) == []


@pytest.mark.parametrize(
    ("verdict", "with_fault", "without", "left", "named"),
    [
        ("data", 0, 1, "", ("backlash", "early_row")),
        ("effect", 2, 1, "", ("backlash",)),
        ("effect", 2, 1, "much", ("backlash", "early_row")),
        ("effect", 1, 2, "", ("backlash", "early_row")),
    ],
)
def test_a_fault_that_spares_no_effect_is_left_out(monkeypatch, made_up, verdict, with_fault, without, left, named):
    def found(count: int, **changes) -> Diagnosis:
        """A diagnosis with so many effects in its model."""
        fit = SimpleNamespace(problem=SimpleNamespace(effects=[None] * count))
        return dataclasses.replace(made_up.diagnosis("effect"), fit=fit, **changes)

    monkeypatch.setattr(doubt, "_gains", lambda *_: np.zeros(9))
    fault = SimpleNamespace(name="early_row", moved=None)
    right = found(with_fault, verdict=Verdict(verdict), fault=fault, effects=("early_row",) + ("lag",) * with_fault)
    said = found(without, effects=("backlash",), left=left)
    assert doubt.more_likely(right, said).effects == named


def test_sets_are_compared_by_the_grasps_that_none_has_left_out(sound, refitted):
    """A grasp that went wrong may be left out beside effects alone, or once the set was put right alone."""
    (target, _, base), last = refitted, np.arange(2, 9)
    fewer = target.subset(last), base.fit.subset(last)
    fault = Fault("time_scale", "", "", sound[0])
    for right, said in ((fewer, (target, base.fit)), ((target, base.fit), fewer)):
        gains = doubt._gains(fault, right, said)
        assert gains.shape == (7,)
        assert np.abs(gains).max() < 20.0  # it is the same grasps: those of others would differ by hundreds


def test_swapped_force_columns_are_told(sound):
    loaded, model = sound
    swapped = changed(loaded, lambda g: dataclasses.replace(g, force_n=g.force_n[:, ::-1]))
    diagnosis, _ = diagnose_set(swapped, model, ["swapped_forces"], 0, silent)
    assert (diagnosis.verdict, diagnosis.effects) == ("data", ("swapped_forces",))
    assert "press on one finger by hand" in answer(diagnosis)


def row_late(values: np.ndarray) -> np.ndarray:
    """Each row holds what the one before should."""
    return np.concatenate([values[:1], values[:-1]])


def row_early(values: np.ndarray) -> np.ndarray:
    """Each row holds what the next one should."""
    return np.concatenate([values[1:], values[-1:]])


@pytest.mark.parametrize(("swapped", "told"), [({0, 1, 3}, (0, 1, 3)), ({0}, ()), (set(range(9)), ()), (set(), ())])
def test_forces_are_swapped_in_some_grasps_if_others_show_that_they_are_not(sound, refitted, swapped, told):
    """In one it may be where the object stands, and in all that tell it is an effect of the set."""
    loaded = changed_by_place(sound[0], lambda i, g: {"force_n": g.force_n[:, :: -1 if i in swapped else 1]})
    assert grasps_with_swapped_forces(make_target(loaded.measured, loaded.gripper), refitted[2].fit) == told


@pytest.mark.parametrize(
    ("measured", "name", "told", "change"),
    [
        ("sound", "time_scale", "2 times too long", lambda i, g: {"time_s": 2 * g.time_s}),
        (
            "sound",
            "uneven_stamps",
            "time stamps scatter by 5",
            lambda i, g: {"time_s": g.time_s + np.random.default_rng(i).uniform(-0.009, 0.009, len(g.time_s))},
        ),
        ("sound", "force_tare", "at grasp 4", lambda i, g: {"force_n": g.force_n - [0.2 * (i >= 4), 0.0]}),
        (
            "sound",
            "force_tare",
            "another zero in grasp 4 (f_l_n by -0.4",
            lambda i, g: {"force_n": g.force_n - [0.4 * (i == 4), 0.0]},
        ),
        (
            "sound",
            "force_unit",
            "10 times in",
            lambda i, g: {"force_n": g.force_n * [1.0, 10.0 if i in (3, 5, 7) else 1]},
        ),
        ("sound", "force_zero_drift", "f_l_n by -0.06", lambda i, g: {"force_n": g.force_n - [0.03 * (i % 3), 0.0]}),
        (
            "pressed_harder",
            "force_gain_drift",
            "and f_r_n by +11 %",
            lambda i, g: {"force_n": g.force_n * (1 + 0.015 * i), "session": "1"},
        ),
        (
            "pressed_harder",
            "early_row",
            "forces are what was read one row later",
            lambda i, g: {"force_n": row_early(g.force_n)},
        ),
        (
            "sound",
            "late_side",
            "what qdes_r_m commands is done one row later",
            lambda i, g: {"command_m": np.column_stack([g.command_m[:, 0], row_early(g.command_m[:, 1])])},
        ),
        (
            "sound",
            "swapped_positions",
            "q_l_m and q_r_m stand for one another",
            lambda i, g: {"position_m": g.position_m[:, ::-1]},
        ),
        (
            "sound",
            "some_forces_swapped",
            "f_l_n and f_r_n stand for one another in",
            lambda i, g: {"force_n": g.force_n[:, :: -1 if i < 4 else 1]},
        ),
        ("pressed_harder", "early_row", "positions and forces are", lambda i, g: {"command_m": row_late(g.command_m)}),
    ],
)
def test_a_fault_is_put_right_and_told(request, measured, name, told, change):
    loaded, model = request.getfixturevalue(measured)
    diagnosis, _ = diagnose_set(changed_by_place(loaded, change), model, ["force_bias", "command_delay"], 0, silent)
    assert (diagnosis.verdict, diagnosis.effects) == ("data", (name,))
    assert diagnosis.error_before > 1.3 > diagnosis.error_after
    text = answer(diagnosis)
    assert text.startswith(f"Not the model but the set seems to be wrong: {name} (")
    assert told in text
    found = diagnosis_json(diagnosis, None, [], "s")
    assert found["fault"]["name"] == name
    assert told in found["fault"]["words"]


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("time_scale", lambda i, g: {"time_s": 1.5 * g.time_s}),
        ("force_tare", lambda i, g: {"force_n": g.force_n - [0.05 * (i >= 4), 0.0]}),
    ],
)
def test_what_the_log_tells_is_found_beside_an_effect_that_hides_it(sound, name, change):
    """Encoders that read 0.4 mm too much leave far more than either fault does."""
    loaded, model = sound
    spoilt = changed_by_place(loaded, lambda i, g: {"position_m": g.position_m + 4e-4, **change(i, g)})
    diagnosis, _ = diagnose_set(spoilt, model, ["encoder_bias"], 0, silent)
    assert (diagnosis.verdict, diagnosis.effects) == ("effect", (name, "encoder_bias"))
    assert diagnosis.error_after < 1.1


def test_two_faults_are_told_together(sound):
    """Of stamps, and of what is seen once they are put right."""
    loaded, model = sound

    def spoilt(place, grasp):
        scatter = np.random.default_rng(place).uniform(-0.009, 0.009, len(grasp.time_s))
        return {"time_s": grasp.time_s + scatter, "force_n": grasp.force_n - [0.2 * (place >= 4), 0.0]}

    diagnosis, _ = diagnose_set(changed_by_place(loaded, spoilt), model, ["force_bias"], 0, silent)
    assert (diagnosis.verdict, diagnosis.effects) == ("data", ("uneven_stamps", "force_tare"))
    assert diagnosis.error_after < 1.3
    text = answer(diagnosis)
    assert "uneven_stamps (time stamps scatter by 5" in text
    assert ") and force_tare (the zero changes at grasp 4" in text


@pytest.mark.parametrize(
    ("effects", "spoil"),
    [
        (("time_scale", "force_tare", "object_radius"), ("clock", "tare", "radius")),
        (("swapped_positions", "force_tare"), ("columns", "tare")),
        (("object_radius", "force_tare"), ("far", "tare")),
    ],
)
def test_several_faults_are_put_right_one_after_the_other(sound, effects, spoil):
    loaded, model = sound

    def spoilt(place, grasp):
        changes = {
            "clock": {"time_s": 1.5 * grasp.time_s},
            "tare": {"force_n": grasp.force_n - [0.2 * (place >= 4), 0.0]},
            "radius": {"radius_m": grasp.radius_m + 0.001 * (grasp.object == "thing_0")},
            "far": {"radius_m": grasp.radius_m + 0.003 * (grasp.object == "thing_0")},
            "columns": {"position_m": grasp.position_m[:, ::-1]},
        }
        return {name: value for what in spoil for name, value in changes[what].items()}

    diagnosis, _ = diagnose_set(changed_by_place(loaded, spoilt), model, ["force_bias"], 0, silent)
    assert (diagnosis.verdict, diagnosis.effects) == ("data", effects)
    assert diagnosis.error_after < 1.1
    assert all(f"{name} (" in answer(diagnosis) for name in effects)
    assert "f_l_n by -0.20" in answer(diagnosis)


def test_a_sound_set_has_neither_suspects_nor_odd_grasps(sound, refitted):
    target, _, base = refitted
    assert suspects(sound[0], target, base.fit) == []
    assert odd_grasps(target, base.fit) == ()
    everywhere = dataclasses.replace(base.fit, residual=np.where(target.mask[..., None], 9.0, 0.0))
    assert odd_grasps(target, everywhere) == ()


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


def test_of_each_object_a_grasp_is_left_to_judge_the_others_by():
    errors, labels = np.array([9.0, 8.0, 7.0, 1.0, 2.0, 1.0, 5.0]), ["a", "a", "a", "b", "b", "c", "d"]
    assert odd_grasps_module._suspects(errors, labels, 4).tolist() == [0, 1, 4]
    assert odd_grasps_module._suspects(errors, labels, 1).tolist() == [0]
    assert odd_grasps_module._suspects(errors[-2:], labels[-2:], 1).tolist() == []


def test_the_grasp_that_draws_a_fit_to_itself_is_left_out_first(refitted):
    """One of a hard object among those of a soft one: the fit is its own, and what it leaves is in the others."""
    target, _, base = refitted
    labels = ["soft"] * len(target.grasps)
    jacobian, residual = np.zeros_like(base.fit.jacobian), np.zeros_like(base.fit.residual)
    jacobian[..., 0], residual[target.mask] = 1.0, -4.0
    jacobian[0], residual[0] = 10 * jacobian[0], 10 * np.abs(residual[0])
    astray = dataclasses.replace(base.fit, jacobian=jacobian, residual=residual, vector=base.fit.problem.start())
    assert odd_grasps_module._least_trimmed(astray, labels, 1).tolist() == [0]
    assert odd_grasps_module._least_trimmed(astray, ["hard", *labels[1:]], 1).tolist() != [0]  # its object's only one


def test_a_grasp_that_fits_no_object_is_told_and_does_not_decide(sound):
    loaded, model = sound
    name = loaded.measured.grasps[0].name
    backwards = changed(
        loaded, lambda g: dataclasses.replace(g, force_n=g.force_n[::-1].copy()) if g.name == name else g
    )
    target, _, base = apply_model(backwards, model, silent, refit=True)
    (odd,) = odd_grasps(target, base.fit)
    assert (odd.name, odd.like) == (name, "")
