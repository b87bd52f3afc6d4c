"""What a step of the search fits though its signature promises little."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

from forcegrasp.diagnosis.families import look_alike, roughly_as
from forcegrasp.diagnosis.faults.odd_grasps import OddGrasp
from forcegrasp.diagnosis.few import with_few
from forcegrasp.diagnosis.result import Step, kept_steps
from forcegrasp.diagnosis.search import at_once, conclusion, rough_fits, search
from forcegrasp.diagnosis.search import finalists as finalists_module
from forcegrasp.diagnosis.search import refine as refine_module
from forcegrasp.diagnosis.search import start as start_module
from forcegrasp.diagnosis.search import step as step_module
from forcegrasp.diagnosis.search.finalists import Finalists
from forcegrasp.diagnosis.search.left_over import leaves_forms, leaves_little
from forcegrasp.diagnosis.search.refine import best_as_given, fit_with, refine_anyway
from forcegrasp.diagnosis.search.rough_fits import RoughFits
from forcegrasp.diagnosis.search.screen import Screen
from forcegrasp.diagnosis.search.stalled_base import better_without
from forcegrasp.diagnosis.search.start import Start
from forcegrasp.diagnosis.search.step import look_further
from forcegrasp.diagnosis.signatures import Score
from forcegrasp.diagnosis.study import Study
from forcegrasp.effects import catalogue
from forcegrasp.effects.for_gripper import effect_of
from forcegrasp.effects.setting import EffectSetting
from forcegrasp.identify.cross_validation import make_folds
from forcegrasp.identify.fit import fit_once
from forcegrasp.identify.fit_set import fit_model
from forcegrasp.identify.noise_floor import beyond_fit, numerical_error
from forcegrasp.identify.progress import silent
from tests.light_set import light_gripper, light_set

SMOOTH, PRESLIDING, DELAY, OFFSET = (
    effect_of(name, light_gripper()) for name in ("smooth_friction", "presliding", "command_delay", "motor_offset")
)


@pytest.fixture(scope="module")
def creeping():
    """A set with friction that vanishes smoothly at rest: what was fitted to it, and a study of it."""
    loaded = light_set("smooth_friction force_n=0.1 creep_m_s=0.002", samples=48)
    target, simulators, base = fit_model(loaded, 0, silent)
    numerical = beyond_fit(base.fit, numerical_error(base.fit, target))
    return with_few(Study(target, simulators, make_folds(target.grasps), numerical), base.fit), base


def promising(*effects: str):
    """A screen whose signatures promise something of these effects alone."""

    class Partial(Screen):
        def look(self, *arguments):
            look = super().look(*arguments)
            kept = tuple(score for score in look.worth_a_fit if score.setting.effect.name in effects)
            return dataclasses.replace(look, worth_a_fit=kept)

    return Partial


def looked(creeping, effects, *seen: str, **more) -> Step:
    study, base = creeping
    screen = promising(*seen)(effects, study)
    return look_further(study, base.fit, screen, effects, np.random.default_rng(0), **more)


@pytest.fixture(scope="module")
def alike(creeping) -> Step:
    """A step whose signatures promised one kind of friction, and another was hidden."""
    return looked(creeping, [PRESLIDING, SMOOTH], "presliding")


@pytest.fixture(scope="module")
def fitted_anyway(creeping) -> Step:
    """A step that fitted what promised too little."""
    return looked(creeping, [SMOOTH, DELAY], anyway=True)


def test_a_look_alike_of_its_family_is_fitted_in_the_place_of_what_leaves_more_than_noise(alike):
    assert alike.effects[0] == "smooth_friction"
    assert alike.error_after < 1.05 < next(c for c in alike.candidates if c.effect is PRESLIDING).error_after


def test_whatever_promises_half_of_the_best_is_refitted(creeping, monkeypatch):
    study, base = creeping
    refitted: list[str] = []
    monkeypatch.setattr(step_module, "_REFITTED", 1)
    monkeypatch.setattr(
        RoughFits, "of", lambda self, scores: refitted.extend(s.setting.effect.name for s in scores) or []
    )

    class Three(Screen):
        def look(self, *arguments):
            look = super().look(*arguments)
            first, second, third = look.scores[:3]
            gains = (first, 1.0), (second, 0.6), (third, 0.4)
            return dataclasses.replace(look, worth_a_fit=tuple(dataclasses.replace(s, gain=g) for s, g in gains))

    effects = [PRESLIDING, SMOOTH, OFFSET]
    screen = Three(effects, study)
    look_further(study, base.fit, screen, effects, np.random.default_rng(0))
    assert len(refitted) == 2


def test_a_rough_fit_that_gained_nearly_as_much_is_held_against_what_leaves_more_than_noise(
    creeping, alike, monkeypatch
):
    """A lighter object was ahead of softer contacts, roughly, and took two more effects with it."""
    study, base = creeping
    at_the_end = {c.effect: c for c in alike.candidates}
    ahead, truth = at_the_end[PRESLIDING], at_the_end[SMOOTH]
    problem, vector, fixed = truth.fit.problem, truth.fit.vector.copy(), np.zeros(len(truth.fit.vector), bool)
    vector[-2] *= 0.8
    rough = fit_once(study.target, problem, study.simulators, vector, base.fit.correction, rounds=0, free=fixed)
    rough = dataclasses.replace(truth, fit=rough, share=0.8 * ahead.share, gains=0.8 * ahead.gains)
    finalists = Finalists(Start(study, base.fit), [PRESLIDING, SMOOTH], np.zeros(1))
    monkeypatch.setattr(Finalists, "_at_the_end", lambda _, some, __: [at_the_end[c.effect] for c in some])
    monkeypatch.setattr(Finalists, "_better_look_alikes", lambda *_: [])
    ordered, _ = finalists.fitted([[ahead], [rough]])
    assert [one.effect for one in ordered] == [SMOOTH, PRESLIDING]
    assert ordered[0].error_after < 1.05
    assert finalists._rivals(ahead, [rough], set()) == [rough]
    assert finalists._rivals(ahead, [rough], {"smooth_friction"}) == []
    assert finalists._rivals(ahead, [dataclasses.replace(rough, fit=base.fit)], set()) == []
    assert not finalists._leads_further(ahead, truth.fit, "it")
    # what contains the best one takes its place in the next step, if it earns that
    simple = dataclasses.replace(ahead, setting=EffectSetting.typical(effect_of("coulomb_friction", light_gripper())))
    assert finalists._rivals(simple, [rough], set()) == []


@pytest.mark.parametrize("one_grasp", [True, False])
def test_what_leaves_more_of_all_grasps_is_not_the_best_for_what_one_grasp_gains(
    creeping, alike, monkeypatch, one_grasp
):
    study, base = creeping
    best = alike.candidates[0]
    fit = dataclasses.replace(best.fit, residual=1.2 * best.fit.residual)
    gains = best.gains + (best.heldout_gain * (np.arange(len(best.gains)) == 0) if one_grasp else 0.2 * best.gains)
    other = dataclasses.replace(best, setting=EffectSetting.typical(OFFSET), fit=fit, gains=gains - 0.1)
    monkeypatch.setattr(Finalists, "_at_the_end", lambda _, some, __: some)
    monkeypatch.setattr(Finalists, "_better_look_alikes", lambda *_: [])
    ordered, _ = Finalists(Start(study, base.fit), [], np.zeros(1)).fitted([[other], [best]])
    assert ordered[0].effect is (SMOOTH if one_grasp else OFFSET)


@pytest.mark.parametrize(
    ("name", "times", "as_far"), [("object_size", 1.3, True), ("object_size", 9.0, False), ("backlash", 1.3, False)]
)
def test_a_mistake_of_the_set_that_gained_nearly_as_much_is_fitted_as_far_as_the_effect(
    creeping, alike, monkeypatch, name, times, as_far
):
    """Radii that were 2 mm too large left 1.28 roughly, and backlash 1.01 at its end: it was named without a doubt."""
    study, base = creeping
    best, fitted = alike.candidates[0], []
    setting = EffectSetting.typical(effect_of(name, light_gripper()))
    fit = dataclasses.replace(best.fit, residual=times * best.fit.residual)
    rough = dataclasses.replace(best, setting=setting, fit=fit, share=0.8 * best.share, gains=0.8 * best.gains)
    monkeypatch.setattr(
        Finalists, "_at_the_end", lambda _, some, __: fitted.extend(c.effect.name for c in some) or some
    )
    monkeypatch.setattr(Finalists, "_better_look_alikes", lambda *_: [])
    Finalists(Start(study, base.fit), [], np.zeros(1)).fitted([[best], [rough]])
    assert (name in fitted) == as_far


@pytest.mark.parametrize(("known", "times", "errors"), [(False, 1.3, 1.0), (True, 1.3, 2.0), (True, 1.6, 1.0)])
def test_where_effects_leave_little_a_gain_is_to_be_two_standard_errors(creeping, alike, known, times, errors):
    """Of a backlash's 24 grasps two held what was left, whose contacts had gone another way: a compliance was found."""
    study, base = creeping
    fit = alike.candidates[0].fit if known else base.fit
    noise = np.random.default_rng(2).standard_normal(fit.residual.shape) * study.target.mask[..., None]
    start = Start(study, dataclasses.replace(fit, residual=times * noise))
    assert start.error == pytest.approx(times, rel=0.05)
    count = len(study.target.grasps)
    even = 10.0 * np.sqrt(count / (count - 1)) * np.resize([-1.0, 1.0], count)  # their standard deviation is 10
    for gain in (0.99 * errors, 1.01 * errors):
        gains = even - even.mean() + gain * even.std(ddof=1) / np.sqrt(count)
        candidate = dataclasses.replace(alike.candidates[0], gains=gains + 0, p_family=0.002)
        assert start.shows(candidate) == (gain > errors)


@pytest.mark.parametrize("leads", [False, True])
def test_what_leaves_more_than_the_model_without_it_is_fitted_to_the_end_only_if_few_grasps_ask(
    creeping, alike, monkeypatch, leads
):
    study, base = creeping
    (best, *_), fitted = alike.candidates, []
    worse = dataclasses.replace(best, fit=dataclasses.replace(best.fit, residual=1.01 * base.fit.residual))
    monkeypatch.setattr(Finalists, "_leads_further", lambda *_: leads)
    monkeypatch.setattr(Finalists, "_at_the_end", lambda _, some, __: fitted.extend(some) or some)
    finalists = Finalists(Start(study, base.fit), [], np.zeros(1))
    ordered, _ = finalists.fitted([[dataclasses.replace(worse, gains=-best.gains)]])
    assert bool(fitted) == leads
    assert [one.effect for one in ordered] == [best.effect]


def test_what_was_fitted_for_another_screen_is_not_fitted_again(creeping, alike, monkeypatch):
    """A screen that is simulated anew promises other things, and what was fitted stays as it was."""
    study, base = creeping
    screen = promising("presliding", "smooth_friction")([PRESLIDING, SMOOTH], study)
    rng, refitted = np.random.default_rng(0), []
    monkeypatch.setattr(RoughFits, "of", lambda self, scores: refitted.extend(s.setting.effect for s in scores) or [])
    nothing = [dataclasses.replace(c, gains=0 * c.gains, share=0.0) for c in alike.candidates if c.effect is PRESLIDING]
    before = dataclasses.replace(alike, effects=(), candidates=tuple(nothing))
    step = look_further(study, base.fit, screen, [PRESLIDING, SMOOTH], rng, before=before.candidates)
    assert set(refitted) == {SMOOTH}
    assert step.effects == ()
    assert step.candidates == before.candidates
    found = dataclasses.replace(alike, effects=(), candidates=alike.candidates[:1])
    assert (
        look_further(study, base.fit, screen, [PRESLIDING], rng, before=found.candidates).effects == alike.effects[:1]
    )


def test_what_is_worth_no_fit_roughly_is_not_fitted_to_the_end_where_others_were(creeping, alike, monkeypatch):
    study, base = creeping
    best, other = alike.candidates[:2]
    nothing = dataclasses.replace(best, gains=0 * best.gains)
    fitted: list[str] = []
    monkeypatch.setattr(
        Finalists,
        "_at_the_end",
        lambda _, some, __: fitted.extend(c.effect.name for c in some) or [nothing for _ in some],
    )
    for gains in (other.gains, 0 * other.gains + 0.01):
        fitted.clear()
        finalists = Finalists(Start(study, base.fit), [], np.zeros(1))
        finalists.fitted([[best], [dataclasses.replace(other, gains=gains)]])
        assert (other.effect.name in fitted) == (gains.sum() > 1)


@pytest.mark.long
def test_signatures_that_promise_nothing_ask_for_no_fit_to_the_end_where_rough_fits_show_nothing(creeping, monkeypatch):
    monkeypatch.setattr(Finalists, "_at_the_end", lambda _, some, __: pytest.fail("fitted to the end") if some else [])
    monkeypatch.setattr(Start, "shows", lambda *_: False)
    assert looked(creeping, [SMOOTH, DELAY], anyway=True).effects == ()


def test_where_noise_alone_is_left_no_look_alike_is_fitted(creeping, monkeypatch):
    monkeypatch.setattr("forcegrasp.diagnosis.search.finalists.refine_anyway", lambda *_: pytest.fail("fitted another"))
    assert looked(creeping, [PRESLIDING, SMOOTH], "smooth_friction").effects == ("smooth_friction",)


@pytest.mark.parametrize(("share", "of_any_family"), [(0.95, False), (0.8, True)])
def test_what_explains_little_may_be_of_the_wrong_family(creeping, fitted_anyway, monkeypatch, share, of_any_family):
    """Objects of 150 g in place of 400 g were a lag of the motors."""
    study, base = creeping
    best = dataclasses.replace(fitted_anyway.candidates[0], share=share)
    tried = []
    monkeypatch.setattr(
        "forcegrasp.diagnosis.search.finalists.refine_anyway", lambda effects, *_: tried.extend(effects) or []
    )
    effects = list(catalogue().values())
    assert Finalists(Start(study, base.fit), [], np.zeros(1))._better_look_alikes(best, effects) == []
    alike = {e for e in effects if look_alike(e, SMOOTH) and (of_any_family or e.family == SMOOTH.family)}
    richer = {e for e in alike if SMOOTH.name in {nested.effect for nested in e.contains}}
    assert richer
    assert set(tried) == alike - richer  # these may take its place in the next step
    assert any(e.family != SMOOTH.family for e in tried) == of_any_family


def test_what_promises_too_little_is_fitted_where_it_is_asked_for(creeping, fitted_anyway):
    assert looked(creeping, [SMOOTH, DELAY]).effects == ()
    assert fitted_anyway.effects == ("smooth_friction",)
    assert fitted_anyway.candidates[0].parameters()["force_n"] == pytest.approx(0.1, rel=0.1)


@pytest.mark.parametrize(
    ("share", "least_together", "found"),
    [(0.4, 9.0, ()), (0.6, 9.0, ("smooth_friction",)), (0.4, 0.0, ("smooth_friction",))],
)
def test_where_all_promise_little_together_and_none_explains_half_nothing_is_fitted_to_the_end(
    creeping, fitted_anyway, monkeypatch, share, least_together, found
):
    """A late velocity, which no effect is, was backlash between two masses and damped contacts after 20 minutes."""
    rough = [dataclasses.replace(c, share=share) for c in fitted_anyway.candidates]
    monkeypatch.setattr(RoughFits, "anyway", lambda *_: rough)
    monkeypatch.setattr(Finalists, "fitted", lambda *_: (fitted_anyway.candidates, set()))
    step = looked(creeping, [SMOOTH, DELAY], anyway=True, least_together=least_together)
    assert step.effects == found
    assert step.of_none == (not found)
    assert [c.effect for c in step.candidates] == [c.effect for c in fitted_anyway.candidates]


@pytest.mark.long
def test_of_rough_fits_those_that_gain_much_less_than_the_best_one_are_left_out(creeping):
    study, base = creeping
    fits = refine_anyway([SMOOTH, DELAY, OFFSET], study, base.fit)
    assert [fit.problem.effects[-1].effect for fit in fits] == [SMOOTH]
    assert len(fits[0].residual) == len(base.fit.residual)
    assert refine_anyway([DELAY], study, fits[0], "smooth_friction") == []


def test_a_fit_that_had_stalled_goes_on_without_the_effect_that_led_it_on(creeping, alike):
    """Any parameter more leads on where a fit had stopped short: its effect is not what was missing."""
    study, base = creeping
    friction = alike.candidates[0].fit  # right, and the base for another effect here
    delayed = fit_with([EffectSetting.typical(DELAY)], friction.vector, study, friction)
    null = np.r_[friction.vector, DELAY.parameters[0].null]
    nothing = dataclasses.replace(delayed, vector=null)
    stalled = dataclasses.replace(friction, residual=1.1 * friction.residual)
    better = better_without("command_delay", nothing, stalled, study)
    assert better is not None
    assert [one.effect.name for one in better.problem.effects] == ["smooth_friction"]
    assert better.cost == pytest.approx(friction.cost, rel=1e-3)
    assert better_without("command_delay", nothing, friction, study) is None
    assert better_without("smooth_friction", friction, base.fit, study) is None  # which was missing


def test_a_search_begins_anew_from_a_better_base(creeping, alike, monkeypatch):
    study, base = creeping
    stalled, fits = dataclasses.replace(base, fit=dataclasses.replace(base.fit, residual=1.1 * base.fit.residual)), []

    def step(study, fit, *_, **__):
        fits.append(fit)
        return alike

    monkeypatch.setattr(search, "look_further", step)
    monkeypatch.setattr(search, "better_without", lambda *_: base.fit if len(fits) == 1 else None)
    monkeypatch.setattr(at_once.AtOnce, "that_add_up", lambda *_: False)
    found = search.diagnose(study.target, stalled, study.simulators, [SMOOTH, DELAY], np.random.default_rng(0))
    assert [one is fit for one, fit in zip(fits, (stalled.fit, base.fit), strict=False)] == [True, True]
    assert found.base.fit is base.fit
    assert found.error_before == pytest.approx(study.error(study.heldout(base.fit)))


@pytest.mark.parametrize("error", [2.0, 29.0, 31.0])
def test_a_search_fits_anyway_once_and_judges_odd_grasps_again(creeping, fitted_anyway, monkeypatch, error):
    """With a hundred times the noise left, a real drive got a force limit that no signature had promised."""
    study, base = creeping
    nothing, asked, screens, together = Step((), (), (), error, error), [], [], []

    def step(study, fit, screen, *_, anyway=False, least_together=0.0, **__):
        asked.append(anyway)
        together.append(least_together > 0)
        screens.append(screen)
        return fitted_anyway if anyway and asked.count(True) == 1 else nothing

    def odd(target, fit):
        return () if fit.problem.effects else (OddGrasp("3", "thing_0", 9.0),)

    monkeypatch.setattr(search, "look_further", step)
    for module in (search, conclusion):
        monkeypatch.setattr(module, "odd_grasps", odd)
    monkeypatch.setattr("forcegrasp.diagnosis.search.left_over.left_over", lambda *_: ("somewhere", None))
    monkeypatch.setattr(search, "leaves_more_than_noise", lambda *_: True)
    for what in ("leaves_little", "leaves_forms"):
        monkeypatch.setattr(search, what, lambda *_: False)
    for module, name in ((search, "exchange"), (search, "split"), (at_once, "add_several")):
        monkeypatch.setattr(module, name, lambda *_: None)
    monkeypatch.setattr(conclusion, "may_be_forms", lambda *_: False)
    diagnosis = search.diagnose(study.target, base, study.simulators, [SMOOTH, DELAY], np.random.default_rng(0))
    # beside what was found, signatures are others
    assert asked == ([False, True, False, False] if error < 30 else [False])
    assert together == [True, True, False, False][: len(asked)]  # of the base model alone
    assert [screen is screens[0] for screen in screens] == [True, True, True, False][: len(screens)]
    assert diagnosis.preferred == (("smooth_friction",) if error < 30 else ())
    assert len(diagnosis.odd) == (error > 30)


@pytest.mark.parametrize(("little", "tried"), [(0.1, []), (-1.0, [DELAY])])
def test_no_effect_is_tried_beside_what_leaves_little_unless_it_explains_half_of_that(
    creeping, fitted_anyway, monkeypatch, little, tried
):
    """What takes the rest makes up for the form of what was found: an object ten times too light, behind a lag."""
    study, base = creeping
    nothing, asked = Step((), (), (), 1.05, 1.05), []

    def look_further(study, fit, screen, effects, *_, **__):
        asked.append(effects)
        return nothing if asked[1:] else fitted_anyway

    monkeypatch.setattr(search, "look_further", look_further)
    monkeypatch.setattr(search, "most_gained_by_one", lambda *_: 0.0)
    monkeypatch.setattr(conclusion, "may_be_forms", lambda *_: False)
    for module in (search, conclusion):
        monkeypatch.setattr(module, "odd_grasps", lambda *_: ())
    monkeypatch.setattr("forcegrasp.diagnosis.search.left_over.left_over", lambda *_: ("somewhere", None))
    monkeypatch.setattr("forcegrasp.diagnosis.search.left_over._LITTLE", little)
    diagnosis = search.diagnose(study.target, base, study.simulators, [SMOOTH, DELAY], np.random.default_rng(0))
    assert diagnosis.preferred == (("smooth_friction",))
    assert list(asked[1]) == tried


@pytest.mark.parametrize(
    ("before", "after", "floor", "is_little"),
    [
        (2.4, 1.05, 1.02, True),
        (2.4, 1.2, 1.02, False),
        (1.2, 1.09, 1.02, False),
        (9.0, 1.5, 1.02, False),
        (1.47, 1.24, 1.38, True),  # what the simulation's own error may be
        (1.3, 1.24, 1.38, True),
    ],
)
def test_little_is_near_the_floor_and_a_small_part_of_what_was_beyond_it(before, after, floor, is_little):
    study = SimpleNamespace(heldout=lambda fit: None, error=lambda held: after)
    assert leaves_little(study, None, before, floor) == is_little


@pytest.mark.parametrize(
    ("before", "after", "of_forms"), [(4.8, 1.13, True), (4.8, 1.25, False), (2.2, 1.1, False), (20.0, 1.6, False)]
)
def test_forms_leave_a_very_small_part_of_a_large_error(before, after, of_forms):
    study = SimpleNamespace(heldout=lambda fit: None, error=lambda held: after)
    assert leaves_forms(study, None, before, 1.01) == of_forms


def test_what_replaces_the_law_of_contacts_is_fitted_however_little_it_promises(creeping, monkeypatch):
    study, base = creeping
    fitted: list[str] = []
    monkeypatch.setattr(rough_fits, "refine_anyway", lambda effects, *_: fitted.extend(e.name for e in effects) or [])
    monkeypatch.setattr(rough_fits, "best_as_given", lambda *_: [])
    effects = sorted(catalogue().values(), key=lambda effect: bool(effect.instead_of))
    scores = [Score(EffectSetting.typical(effect), 0.0, np.zeros(1)) for effect in effects]
    RoughFits(Start(study, base.fit), np.zeros(1)).anyway(scores)
    assert fitted == [effect.name for effect in effects[:12]] + ["hunt_crossley_contact"]


@pytest.mark.parametrize(
    ("of_forms", "left", "fitted"), [(True, "somewhere", []), (False, "", []), (False, "somewhere", [True])]
)
def test_effects_that_promise_little_are_not_fitted_for_what_forms_or_noise_leave(
    creeping, fitted_anyway, monkeypatch, of_forms, left, fitted
):
    """Beside one that was found; signatures are asked once more, for an effect may look like stronger noise."""
    study, base = creeping
    asked = []

    def step(study, fit, *_, anyway=False, **__):
        asked.append(anyway)
        return Step((), (), (), 2.0, 2.0) if fit.problem.effects else fitted_anyway

    monkeypatch.setattr(search, "look_further", step)
    for module in (search, conclusion):
        monkeypatch.setattr(module, "odd_grasps", lambda *_: ())
    monkeypatch.setattr("forcegrasp.diagnosis.search.left_over.left_over", lambda *_: (left, None))
    monkeypatch.setattr(search, "is_worth_looking", lambda *_: True)
    monkeypatch.setattr(search, "leaves_little", lambda *_: False)
    monkeypatch.setattr(search, "leaves_forms", lambda *_: of_forms)
    for module, name in ((search, "exchange"), (search, "split"), (at_once, "add_several")):
        monkeypatch.setattr(module, name, lambda *_: None)
    monkeypatch.setattr(conclusion, "may_be_forms", lambda *_: False)
    search.diagnose(study.target, base, study.simulators, [SMOOTH, DELAY], np.random.default_rng(0))
    assert asked == [False, False, False, *fitted]


def test_an_effect_that_comes_back_after_it_gave_way_is_kept(made_up):
    first = made_up.diagnosis("effect").steps[0]
    second = dataclasses.replace(
        first, effects=("force_drift",), candidates=(dataclasses.replace(first.candidates[1], replaces="force_bias"),)
    )
    again = dataclasses.replace(first)
    assert first.effects == ("force_bias",)
    assert [step.effects[0] for step in kept_steps([first, second])] == ["force_drift"]
    assert [step.effects[0] for step in kept_steps([first, second, again])] == ["force_drift", "force_bias"]


@pytest.mark.parametrize(
    ("left", "alike", "of_set", "first"),
    [
        (1.6, True, True, "backlash"),
        (1.6, False, True, "backlash_asymmetry"),
        (1.6, True, False, "backlash_asymmetry"),
        (1.0, True, True, "backlash_asymmetry"),  # nothing is left that another effect could explain
    ],
)
def test_what_an_effect_contains_comes_first_where_the_set_may_be_wrong_instead(
    monkeypatch, left, alike, of_set, first
):
    """Encoders that are off, and objects that are smaller than the set says, are backlash that differs by finger."""
    monkeypatch.setattr(finalists_module, "rms_error", lambda *_: left)
    monkeypatch.setattr(finalists_module, "indistinguishable", lambda *_: alike)
    monkeypatch.setattr(start_module, "is_significant", lambda one, least, *_: least < 0.1)
    monkeypatch.setattr(Finalists, "_at_the_end", lambda _, some, __: some)
    start = object.__new__(Start)
    start.study, start.fit = SimpleNamespace(target=None), None
    start.least_gain, start._least_errors = 0.02, 1.0
    finalists = Finalists(start, [], np.zeros(1))
    names = ("backlash_asymmetry", "backlash", "object_size" if of_set else "encoder_bias")
    ordered = [SimpleNamespace(effect=effect_of(n, light_gripper()), replaces="", fit=None) for n in names]
    winner, later = finalists.simpler_first(ordered)
    assert winner.effect.name == first
    assert later == {"backlash_asymmetry"} - {first}
    start.least_gain = 0.1  # the simpler one explains too little
    assert finalists.simpler_first(ordered)[0].effect.name == "backlash_asymmetry"


@pytest.mark.long
def test_a_mistake_of_the_set_is_held_against_effects_that_look_like_it(monkeypatch):
    """Whatever their signatures promise: behind a motor that touches late, objects seem smaller."""
    loaded = light_set("object_size error_m=-0.0006", grasps=9, samples=48)
    target, simulators, base = fit_model(loaded, 0, silent)
    numerical = beyond_fit(base.fit, numerical_error(base.fit, target))
    study = with_few(Study(target, simulators, make_folds(target.grasps), numerical), base.fit)
    effects = [effect_of(name, light_gripper()) for name in ("object_size", "backlash", "coulomb_friction")]
    step = looked((study, base), effects, "object_size")
    assert set(step.effects) == {one.effect.name for one in step.candidates} == {"object_size", "backlash"}
    monkeypatch.setattr(finalists_module, "refine_anyway", lambda *_: [])
    assert looked((study, base), effects, "object_size").effects == ("object_size",)


@pytest.mark.long
@pytest.mark.parametrize(("much", "begun"), [(0.5, 2), (1e3, 0)])
def test_where_much_is_left_effects_are_fitted_from_parameters_as_given_too(creeping, monkeypatch, much, begun):
    study, base = creeping
    begins = []

    def recorded(settings, *arguments, begin=None, **more):
        begins.append(begin)
        return roughly_as(settings, *arguments, begin=begin, **more)

    # a base fit that has gone elsewhere
    name = "position_gain"
    (index,) = [i for i, entry in enumerate(base.fit.problem.entries) if entry.name == name]
    off = base.fit.vector.copy()
    off[index] += 1.0
    stuck = fit_once(study.target, base.fit.problem, study.simulators, off, free=np.zeros(len(off), bool))
    monkeypatch.setattr(refine_module, "roughly_as", recorded)
    monkeypatch.setattr(refine_module, "_MADE_UP", much)
    (found,) = refine_anyway([SMOOTH], study, stuck)
    assert sum(one is not None for one in begins) == begun  # on few grasps, and on all
    if begun:
        assert begins[1][index] == base.fit.problem.start()[index]
        assert found.effect("smooth_friction").values[0] == pytest.approx(0.1, rel=0.15)


@pytest.mark.parametrize(("much", "found"), [(0.5, [SMOOTH]), (1e3, [])])
def test_which_effects_leave_least_beside_parameters_as_given(creeping, monkeypatch, much, found):
    study, base = creeping
    monkeypatch.setattr(refine_module, "_MADE_UP", much)
    effects = [DELAY, SMOOTH, OFFSET]
    assert best_as_given(effects, study, base.fit, 1) == found
    ordered = best_as_given(effects, study, base.fit, 9)
    assert len(ordered) == 3 * len(found)
    asked = []
    monkeypatch.setattr(rough_fits, "refine_anyway", lambda effects, *_: asked.extend(effects) or [])
    monkeypatch.setattr(rough_fits, "_FITTED_ANYWAY", 1)
    monkeypatch.setattr(rough_fits, "_AS_GIVEN", 1)
    scores = Screen(effects, study).look(study, base.fit, Start(study, base.fit).background, effects, None,
                                         np.random.default_rng(0)).scores  # fmt: skip
    monkeypatch.setattr(rough_fits, "best_effects", lambda *_: [OFFSET, DELAY, SMOOTH])
    RoughFits(Start(study, base.fit), np.zeros(1)).anyway(scores)
    assert asked == [OFFSET, *found]
