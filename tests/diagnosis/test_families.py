"""Effects that contain simpler ones: which of them is the answer, and what becomes of fits that stalled."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

from forcegrasp.diagnosis import evidence, families
from forcegrasp.diagnosis.add_effect import add_effect
from forcegrasp.diagnosis.diagnose_set import diagnose_set
from forcegrasp.diagnosis.evidence import add_nothing, outdone
from forcegrasp.diagnosis.result import kept_steps
from forcegrasp.diagnosis.search import finalists as finalists_module
from forcegrasp.diagnosis.search.finalists import Finalists
from forcegrasp.diagnosis.search.search import left_to_try
from forcegrasp.diagnosis.search.start import Start
from forcegrasp.diagnosis.study import Study
from forcegrasp.effects import get_effect
from forcegrasp.effects.for_gripper import effect_of, effects_of
from forcegrasp.effects.setting import EffectSetting
from forcegrasp.identify.base_fit import BaseFit
from forcegrasp.identify.fit import fit_exactly
from forcegrasp.identify.fit_set import fit_model
from forcegrasp.identify.fitted_model import model_of
from forcegrasp.identify.loading import Loaded
from forcegrasp.identify.predict import predict
from forcegrasp.identify.problem import Problem
from forcegrasp.identify.simulators import Simulators
from forcegrasp.identify.target import Target
from forcegrasp.importers.example import example_set
from forcegrasp.physics import load_gripper
from forcegrasp.replay.replay import Replay

SAMPLES = 130
FRICTION = ["coulomb_friction", "stiction"]


def silent(text: str) -> None:
    """Takes what a diagnosis tells about its progress."""


def containers(gripper):
    return [(effect, nested) for effect in effects_of(gripper).values() for nested in effect.contains]


@pytest.mark.parametrize("name", ["tiago", "so101_gripper", "so101_jaw"])
def test_shared_values_are_carried_over_both_ways(name):
    gripper = load_gripper(name)
    for effect, nested in containers(gripper):
        member = effects_of(gripper)[nested.effect]
        simple = EffectSetting(member, "", 0.7 * member.typical_values())
        for rich in families.richer(simple, effect):
            back = families.simpler(rich, nested, gripper)
            for its in nested.same.values():
                assert back.values[member.index(its)] == simple.values[member.index(its)]


def test_effects_that_contain_one_another_are_related():
    stiction, coulomb, backlash = (get_effect(n) for n in ("stiction", "coulomb_friction", "backlash"))
    assert families.contain(stiction, coulomb)
    assert families.contain(coulomb, stiction)
    assert not families.contain(stiction, backlash)


@pytest.mark.parametrize(
    ("lead", "fits_better", "falls_back", "redundant"),
    [
        (np.array([3.0, -3.0, 2.0, -2.0]), True, False, True),  # no lead
        (np.full(4, 3.0), True, False, True),  # a sure one, of 3 % of what the simple one gains
        (np.full(4, 30.0), True, False, False),
        (np.full(4, 30.0), False, False, True),  # of held-out grasps alone, whose predictions are linear
        (np.full(4, 30.0), True, True, True),  # of what it has besides, which can't be told from nothing
    ],
)
def test_an_effect_must_explain_more_than_the_one_it_contains(
    made_up, monkeypatch, lead, fits_better, falls_back, redundant
):
    monkeypatch.setattr(families, "falls_back", lambda fit, nested: falls_back)
    good = made_up.diagnosis("effect").steps[0].candidates[0]

    def candidate(name: str, gains: np.ndarray, less: float = 1.0):
        fit = dataclasses.replace(good.fit, residual=less * good.fit.residual)
        return dataclasses.replace(good, setting=EffectSetting.typical(get_effect(name)), gains=gains, fit=fit)

    simple = candidate("coulomb_friction", np.full(4, 100.0))
    rich = candidate("stiction", 100.0 + lead, 0.9 if fits_better else 1.0)
    assert add_nothing([simple, rich]) == ({"stiction"} if redundant else set())
    assert add_nothing([rich, candidate("backlash", np.full(4, 100.0))]) == set()


@pytest.mark.parametrize(
    ("less", "leaves_noise", "redundant"), [(0.5, True, False), (0.9, True, True), (0.5, False, True)]
)
def test_of_much_error_what_leaves_only_noise_is_more_than_what_gains_nearly_as_much(
    made_up, monkeypatch, less, leaves_noise, redundant
):
    """Coulomb's friction gained 95 % of what presliding did, 7.5 × noise, and left 1.7; presliding left 1.02."""
    monkeypatch.setattr(families, "falls_back", lambda fit, nested: False)
    good = made_up.diagnosis("effect").steps[0].candidates[0]
    simple = dataclasses.replace(good, setting=EffectSetting.typical(get_effect("coulomb_friction")))
    fit = dataclasses.replace(good.fit, residual=less * good.fit.residual)
    rich = dataclasses.replace(
        good, setting=EffectSetting.typical(get_effect("presliding")), gains=1.03 * good.gains, fit=fit
    )
    enough = (1.1 if leaves_noise else 0.9) * fit.cost
    assert add_nothing([simple, rich], enough) == ({"presliding"} if redundant else set())
    assert add_nothing([simple, rich]) == {"presliding"}


@pytest.mark.parametrize(
    ("times", "one_grasp", "replaces", "is_behind"),
    [(1.2, True, "", True), (1.05, True, "", False), (1.2, False, "", False), (1.2, True, "it", False)],
)
def test_what_leaves_more_of_all_grasps_is_no_better_for_what_one_grasp_gains(
    made_up, times, one_grasp, replaces, is_behind
):
    """Late readings left 2.9 × noise and a delay 2.1, which gained less: one grasp held an object's stiffness."""
    good = made_up.diagnosis("effect").steps[0].candidates[0]
    fit = dataclasses.replace(good.fit, residual=times * good.fit.residual)
    more = np.full(len(good.gains), 10.0)
    if one_grasp:
        more = np.resize([3.0, -2.0], len(more))
        more[0] = 100.0
        assert evidence.is_beyond_chance(more, 0.0)
    setting = EffectSetting.typical(get_effect("readout_skew"))
    worse = dataclasses.replace(good, setting=setting, fit=fit, gains=good.gains + more, replaces=replaces)
    assert worse.heldout_gain > good.heldout_gain
    assert outdone([worse, good]) == ([worse] if is_behind else [])


@pytest.mark.parametrize(("creep", "redundant"), [(0.0, True), (1e-7, True), (5e-6, False)])
def test_an_effect_that_has_become_the_one_it_contains_adds_nothing_whatever_it_gains(
    made_up, monkeypatch, creep, redundant
):
    """Friction that fell below 0.2 µm/s held the finger for some steps, as a delay does, and was taken for it."""
    monkeypatch.setattr(families, "falls_back", lambda fit, nested: False)
    good = made_up.diagnosis("effect").steps[0].candidates[0]
    simple = dataclasses.replace(good, setting=EffectSetting.typical(get_effect("coulomb_friction")))
    smooth = EffectSetting(get_effect("smooth_friction"), "", np.array([0.03, creep]))
    fit = dataclasses.replace(good.fit, residual=0.9 * good.fit.residual)
    rich = dataclasses.replace(good, setting=smooth, gains=2 * good.gains, fit=fit)
    assert add_nothing([simple, rich]) == ({"smooth_friction"} if redundant else set())


def jaw_with(effect: str, **values: float) -> Loaded:
    """The commands of the starter set, on a jaw with this effect: read by an encoder, with a little noise."""
    measured, gripper = example_set(), load_gripper("so101_jaw")
    grasps = [
        dataclasses.replace(
            g, time_s=g.time_s[:SAMPLES], command_m=g.command_m[:SAMPLES], position_m=g.position_m[:SAMPLES],
            force_n=g.force_n[:SAMPLES], start=(g.position_m[0], np.zeros(1)),
        )
        for g in measured.grasps[4:]
    ]  # fmt: skip
    hidden = EffectSetting.typical(effect_of(effect, gripper))
    for name, value in values.items():
        hidden.values[hidden.effect.index(name)] = value
    problem = Problem(gripper, grasps, [hidden])
    read = predict(Replay(gripper, grasps, encoders_known=False), [problem.case(problem.start())])[0]
    noisy = read + 0.0003 * np.random.default_rng(0).standard_normal(read.shape)
    found = tuple(dataclasses.replace(g, position_m=q, start=None) for g, q in zip(grasps, noisy, strict=True))
    return Loaded(dataclasses.replace(measured, grasps=found), gripper, [])


@pytest.fixture(scope="module")
def sticking() -> Loaded:
    """A jaw whose friction falls once it slides."""
    return jaw_with("stiction", breakaway_n=0.15)


@pytest.fixture(scope="module")
def fitted(sticking) -> tuple[Target, Simulators, BaseFit]:
    """The base model of that jaw."""
    return fit_model(sticking, 0, silent)


@pytest.mark.long
def test_dry_friction_is_not_called_stiction():
    diagnosis, _ = diagnose_set(jaw_with("coulomb_friction", force_n=0.08), None, FRICTION, 0, silent)
    assert (diagnosis.verdict, diagnosis.effects) == ("effect", ("coulomb_friction",))


@pytest.mark.long
def test_friction_in_the_model_gives_way_to_stiction(sticking, fitted):
    """The step that found the simple one stays in the record; the answer has the richer one alone."""
    target, _, base = fitted
    coulomb = effect_of("coulomb_friction", sticking.gripper)
    model = add_effect(sticking, model_of(base.fit, target, sticking, []), coulomb, silent).model
    diagnosis, _ = diagnose_set(sticking, model, FRICTION, 0, silent)
    assert diagnosis.preferred == ("stiction",)
    assert [one.effect.name for one in diagnosis.fit.problem.effects] == ["stiction"]
    assert diagnosis.steps[-1].replaces == "coulomb_friction"
    assert diagnosis.error_after < 0.8 * diagnosis.error_before


def test_a_fit_stuck_beside_the_effect_it_contains_is_fitted_again_from_there(sticking, fitted):
    target, simulators, base = fitted
    old, gripper = base.fit.problem, sticking.gripper
    problem = Problem(gripper, old.grasps, [EffectSetting.typical(effect_of("coulomb_friction", gripper))])
    member = fit_exactly(target, problem, simulators, np.r_[base.fit.vector, problem.start()[len(old) :]])
    stiction = effect_of("stiction", gripper)
    again = families.refit_as_richer(stiction, member, "coulomb_friction", Study(target, simulators, []))
    assert families.stalled(member, again)
    assert not families.stalled(again, member)
    assert not families.falls_back(again, stiction.contains[0])


@pytest.mark.parametrize(("steps", "falls"), [(0.9, True), (1.1, False)])
def test_a_lag_of_less_than_integrators_differ_by_is_none(made_up, monkeypatch, steps, falls):
    """A ramp simulated in finer steps bent by half a millisecond: that was a lag behind a limit of speed."""
    lag, base = get_effect("rate_limited_lag"), made_up.base.fit
    gripper = base.problem.gripper
    setting = EffectSetting(lag, "", np.array([0.03, steps * gripper.integrators_differ_s]))
    problem = Problem(gripper, base.problem.grasps, [setting])
    slopes = np.random.default_rng(0).normal(0, 1e4, (*base.residual.shape, len(problem)))  # fixed to a microsecond
    fit = dataclasses.replace(base, problem=problem, vector=problem.start(), jacobian=slopes)
    assert families.falls_back(fit, lag.contains[0]) == falls
    monkeypatch.setitem(vars(gripper), "steps_as_its_drive", True)
    assert not families.falls_back(fit, lag.contains[0])


def test_a_step_whose_effect_was_replaced_is_not_part_of_the_answer(made_up):
    first = made_up.diagnosis("effect").steps[0]
    richer = dataclasses.replace(first.candidates[0], replaces=first.effects[0])
    second = dataclasses.replace(first, effects=("stiction",), candidates=(richer,))
    assert kept_steps([first, second]) == [second]


def test_what_takes_an_effects_place_does_so_though_another_seemed_better_at_first(made_up, monkeypatch):
    """Rough fits rank another effect first; fitted to the end it is worse."""
    first, second = made_up.diagnosis("effect").steps[0].candidates
    other, richer = (
        dataclasses.replace(c, setting=EffectSetting.typical(get_effect(name)), gains=np.full(8, gain), replaces=place)
        for c, name, gain, place in ((first, "rate_limit", 90.0, ""), (second, "back_emf", 50.0, "force_limit"))
    )
    nothing = (np.zeros_like(made_up.base.fit.residual),) * 2
    study = Study(made_up.target, Simulators(made_up.base.fit.problem), (), nothing)
    start = Start(study, made_up.base.fit)
    monkeypatch.setattr(finalists_module, "to_the_end", lambda rough, _: rough)
    monkeypatch.setattr(start, "judge", lambda *_: dataclasses.replace(other, gains=np.full(8, 10.0)))
    ordered, _ = Finalists(start, [], np.zeros(1)).fitted([[other], [richer]])
    assert [(c.effect.name, c.replaces) for c in ordered] == [("back_emf", "force_limit"), ("rate_limit", "")]


def test_variants_that_rough_fits_cannot_tell_apart_are_all_fitted_to_the_end(made_up, monkeypatch):
    """The one that comes first by a hair may be the worse one on the reference tier."""
    first, fit = made_up.diagnosis("effect").steps[0].candidates[0], made_up.base.fit
    backlash = get_effect("backlash")
    loose, play, command = (
        dataclasses.replace(
            first,
            setting=EffectSetting.typical(backlash, variant),
            fit=dataclasses.replace(fit, residual=share * fit.residual),
        )
        for variant, share in (("loose", 1.0), ("play", 1.001), ("command", 1.02))
    )
    nothing = (np.zeros_like(fit.residual),) * 2
    start, ended = Start(Study(made_up.target, Simulators(fit.problem), (), nothing), fit), []

    def to_the_end(rough, _):
        ended.append(rough)
        return dataclasses.replace(rough, residual=0.5 * rough.residual) if rough is play.fit else rough

    monkeypatch.setattr(finalists_module, "to_the_end", to_the_end)
    monkeypatch.setattr(start, "judge", lambda fit, *_: dataclasses.replace(loose, fit=fit))
    ordered, _ = Finalists(start, [], np.zeros(1)).fitted([[loose, play, command]])
    assert [any(one is rough for one in ended) for rough in (loose.fit, play.fit, command.fit)] == [True, True, False]
    assert [c.fit.cost for c in ordered] == [pytest.approx(0.25 * play.fit.cost)]


@pytest.mark.parametrize(
    ("known", "gave_way", "tried"),
    [
        (
            ["hunt_crossley_contact"],
            "",
            {"backlash", "coulomb_friction", "stiction"},
        ),  # MuJoCo's contact, which stiffens, is gone
        (["stiction"], "", {"backlash", "stiffening_contact", "hunt_crossley_contact"}),  # contains Coulomb friction
        (["coulomb_friction"], "backlash", {"stiffening_contact", "hunt_crossley_contact"}),  # contained in stiction
    ],
)
def test_what_means_nothing_in_a_model_is_not_tried(known, gave_way, tried):
    names = ("coulomb_friction", "stiction", "backlash", "stiffening_contact", "hunt_crossley_contact")
    problem = SimpleNamespace(effects=[EffectSetting.typical(get_effect(name)) for name in known])
    fit, steps = SimpleNamespace(problem=problem), [SimpleNamespace(replaces=gave_way)]
    assert {e.name for e in left_to_try([get_effect(name) for name in names], fit, steps)} == tried


def test_the_variant_that_leaves_least_is_chosen_once_each_is_fitted(monkeypatch):
    """What one leaves before the others have made way for it says little."""
    bias = get_effect("encoder_bias")
    tried = [EffectSetting(bias, variant, np.array([size, 0.0])) for variant in bias.variants for size in (1e-4, 2e-4)]
    unfitted = {("reading", 1e-4): 9.0, ("reading", 2e-4): 8.0, ("loop", 1e-4): 5.0, ("loop", 2e-4): 6.0}
    fitted = {"reading": 1.0, "loop": 4.0}

    def best_start(settings, *_):
        return min(settings, key=lambda one: unfitted[one.variant, one.values[0]]), None, None

    monkeypatch.setattr(families, "_best_start", best_start)
    monkeypatch.setattr(
        families, "fit_once", lambda _, one, *__, **___: SimpleNamespace(one=one, cost=fitted[one.variant])
    )
    study = SimpleNamespace(target=None, simulators=None)
    best = families.roughly_as(tried, SimpleNamespace(correction=None), (), study)
    assert (best.one.variant, best.one.values[0]) == ("reading", 2e-4)
