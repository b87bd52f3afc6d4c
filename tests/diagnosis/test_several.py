"""Effects of which each hides what others do are found together."""

from __future__ import annotations

import dataclasses
import functools
import itertools
from types import SimpleNamespace

import numpy as np
import pytest

from forcegrasp.diagnosis.families import roughly_without
from forcegrasp.diagnosis.few import with_few
from forcegrasp.diagnosis.result import Step
from forcegrasp.diagnosis.search import at_once, conclusion, search, several
from forcegrasp.diagnosis.search.judge import judged
from forcegrasp.diagnosis.search.refine import fit_with
from forcegrasp.diagnosis.search.screen import Screen
from forcegrasp.diagnosis.search.several import (
    _needed,
    add_several,
    add_up,
    most_gained_by_one,
    none_stands_out,
    share_of_alike,
    share_of_all,
    share_of_one,
    usual_on_few,
)
from forcegrasp.diagnosis.search.stop_when import StopWhen
from forcegrasp.diagnosis.study import Study
from forcegrasp.effects.for_gripper import effect_of
from forcegrasp.effects.setting import EffectSetting
from forcegrasp.identify.cross_validation import make_folds
from forcegrasp.identify.fit_set import fit_model
from forcegrasp.identify.noise_floor import beyond_fit, numerical_error
from forcegrasp.identify.progress import silent
from forcegrasp.reports.findings import found_steps
from tests.light_set import light_gripper, light_set

HIDDEN = {
    "command_delay": "delay_s=0.03",
    "coulomb_friction": "force_n=0.06",
    "force_crosstalk": "share=0.12 difference=0.02",
    "force_lag": "time_constant_s=0.06",
    "force_bias": "left_n=0.06 right_n=-0.05",
}
SMALL = {
    "coulomb_friction": "force_n=0.01",
    "force_bias": "left_n=0.02 right_n=-0.01",
    "force_lag": "time_constant_s=0.01",
    "force_gain_asymmetry": "share=0.03",
}
ACTUATOR_LAG = effect_of("actuator_lag", light_gripper())
CATALOGUE = [
    effect_of(name, light_gripper())
    for name in (*HIDDEN, "actuator_lag", "encoder_bias", "force_delay", "force_drift", "force_gain_asymmetry")
]


@functools.cache
def study_of(*hidden: str):
    """A set with these effects hidden, and its base model."""
    target, simulators, base = fit_model(light_set(*hidden, grasps=9), 0, silent)
    numerical = beyond_fit(base.fit, numerical_error(base.fit, target))
    return Study(target, simulators, make_folds(target.grasps), numerical), base


@pytest.fixture(scope="module")
def mixed():
    """Five effects, hidden in one set."""
    return study_of(*(f"{name} {sizes}" for name, sizes in HIDDEN.items()))


def kept_by_nobody(steps, fit):
    """What a round found, thrown away."""
    return False


@pytest.fixture(scope="module")
def found(mixed):
    """What is found in that set."""
    study, base = mixed
    return add_several(study, base.fit, (), CATALOGUE, 0, np.random.default_rng(0), kept_by_nobody)


@pytest.mark.long
def test_all_are_found_and_nothing_else(found):
    steps, fit = found
    assert {one.effect.name for one in fit.problem.effects} == set(HIDDEN)
    assert {step.effects for step in steps} == {(name,) for name in HIDDEN}
    for name, sizes in HIDDEN.items():
        true = [float(size.partition("=")[2]) for size in sizes.split()]
        assert fit.effect(name).values == pytest.approx(true, rel=0.15), name


@pytest.mark.long
def test_steps_lead_from_the_first_error_to_the_last_and_share_out_what_it_falls_by(mixed, found):
    (study, base), (steps, fit) = mixed, found
    assert steps[0].error_before == pytest.approx(study.error(study.heldout(base.fit)))
    assert steps[-1].error_after == pytest.approx(study.error(study.heldout(fit)))
    assert all(one.error_after == pytest.approx(two.error_before) for one, two in itertools.pairwise(steps))
    falls = [step.error_before**2 - step.error_after**2 for step in steps]
    assert falls == sorted(falls, reverse=True)
    assert falls[-1] > 0
    for step in steps:
        (candidate,) = step.candidates
        assert candidate.p_family < 0.01
        assert candidate.heldout_gain > 5
        assert 0 < candidate.share < 1.001  # a fit that leaves no more than noise may leave a little less
        assert candidate.error_after == pytest.approx(step.error_after)
        assert candidate.parameters() == fit.effect(step.effects[0]).parameters


@pytest.mark.long
def test_each_is_shown_beside_all_others(mixed, found):
    """What it changes is told of the final model without it: all came at once, and no step was before it."""
    (_, base), (steps, fit) = mixed, found
    shown = found_steps(SimpleNamespace(base=base, steps=steps))
    for step, before in shown:
        assert {one.effect.name for one in before.problem.effects} == set(HIDDEN) - set(step.effects)
        assert before.cost > 1.02 * fit.cost
    single = [dataclasses.replace(s, candidates=(dataclasses.replace(s.candidates[0], without=None),)) for s in steps]
    assert found_steps(SimpleNamespace(base=base, steps=single))[0][1] is base.fit


@pytest.mark.long
def test_what_was_found_before_stays_if_it_is_needed_and_goes_if_others_make_it_needless(mixed):
    study, base = mixed
    known = [EffectSetting.typical(one) for one in (CATALOGUE[0], ACTUATOR_LAG)]
    fit = fit_with(known, base.fit.vector, study, base.fit)
    held = study.heldout(base.fit)
    candidates = [judged(study, held, fit, one, 0.01, np.ones(1)) for one in known]
    steps = [Step((one.effect.name,), (one,), (), 12.0, 9.0) for one in candidates]
    steps, further = add_several(study, fit, steps, CATALOGUE, 0, np.random.default_rng(0), kept_by_nobody)
    assert {one.effect.name for one in further.problem.effects} == set(HIDDEN)
    assert steps[0].effects == ("command_delay",)
    assert len(steps) == len(HIDDEN)
    assert _needed(study, fit, len(known)) is fit  # what is given stays unasked


def test_of_one_effect_alone_it_stands_out(mixed):
    assert none_stands_out(*at_first(*mixed))
    assert not none_stands_out(*at_first(*study_of("command_delay delay_s=0.03")))


@pytest.fixture(scope="module")
def small():
    """Four small effects, hidden in one set."""
    return study_of(*(f"{name} {sizes}" for name, sizes in SMALL.items()))


@pytest.mark.long
def test_signatures_of_several_effects_add_up(small):
    assert add_up(*at_first(*small))
    assert not add_up(*at_first(*study_of("force_lag time_constant_s=0.06")))  # one alone
    assert not add_up(*at_first(*study_of("command_delay delay_s=0.01")))  # nor that, which a few others mend
    large = "command_delay delay_s=0.1", "coulomb_friction force_n=0.06", "force_lag time_constant_s=0.1"
    assert not add_up(*at_first(*study_of(*large)))  # straight signatures explain too little of what bends


@pytest.mark.long
def test_effects_that_add_up_are_found_at_once(small, monkeypatch):
    study, base = small

    def one_by_one(study, fit, screen, effects, *_, **__):
        assert not effects
        error = study.error(study.heldout(fit))
        return Step((), (), (), error, error)

    monkeypatch.setattr(search, "look_further", one_by_one)
    diagnosis = search.diagnose(study.target, base, study.simulators, CATALOGUE, np.random.default_rng(0))
    assert set(diagnosis.preferred) == set(SMALL)
    for name, sizes in SMALL.items():
        true = [float(size.partition("=")[2]) for size in sizes.split()]
        assert diagnosis.fit.effect(name).values == pytest.approx(true, rel=0.15), name


def test_no_more_are_looked_for_where_what_is_given_explains_most_of_what_they_leave(small, monkeypatch):
    """Then that is moved first, and what was found is told as it is."""
    study, base = small
    asked = []

    def given_first(target, fit):
        asked.append({one.effect.name for one in fit.problem.effects})
        return True

    for module, name in ((search, "look_further"), (search, "merge"), (conclusion, "ask_again")):
        monkeypatch.setattr(module, name, lambda *_, **__: pytest.fail("looked for more"))
    monkeypatch.setattr(several, "_AT_ONCE", 2)
    monkeypatch.setattr(at_once, "EXPLAINED_FAR", 0.5)
    rng = np.random.default_rng(0)
    diagnosis = search.diagnose(
        study.target, base, study.simulators, CATALOGUE, rng, stop_when=StopWhen(given_first=given_first)
    )
    assert len(diagnosis.preferred) == 2
    assert asked == [set(diagnosis.preferred)] * 2  # the base model is not asked
    assert diagnosis.left


@pytest.mark.parametrize("left", ["in all", ""])
def test_rivals_are_not_asked_of_what_leaves_something_where_another_search_goes_on(small, monkeypatch, left):
    study, base = small
    told, tidied, believed = [], [], ("what is sure of it",)

    def adds(so_far, *_):
        so_far.believed = believed

    def concluded(_, *found, in_a_hurry=False):
        told.append((found, in_a_hurry))

    monkeypatch.setattr(search, "_add_effects", adds)
    monkeypatch.setattr(search, "left_over", lambda *_: (left,))
    monkeypatch.setattr(search, "_tidy_up", lambda *_: tidied.append(True))
    monkeypatch.setattr(search, "concluded", concluded)
    monkeypatch.setattr(search, "_believed", lambda *_: SimpleNamespace(base=base))
    rng = np.random.default_rng(0)
    search.diagnose(study.target, base, study.simulators, CATALOGUE, rng, stop_when=StopWhen(goes_on=True))
    assert told == ([(believed, True)] if left else [])
    assert tidied == ([] if left else [True])


def test_one_effect_alone_is_not_several(small, monkeypatch):
    """It was looked for by itself before."""
    study, base = small
    monkeypatch.setattr(several, "_AT_ONCE", 1)
    monkeypatch.setattr(several, "_fitted_together", lambda *_: pytest.fail("fitted one alone"))
    assert add_several(study, base.fit, (), CATALOGUE, 0, np.random.default_rng(0), kept_by_nobody) is None


def test_rounds_end_where_one_leaves_little(small, monkeypatch):
    study, base = small
    monkeypatch.setattr(several, "_AT_ONCE", 1)
    monkeypatch.setattr(several, "_SEVERAL", 1)
    rounds = []

    def keep(steps, fit):
        rounds.append([step.effects[0] for step in steps])
        return len(rounds) == 2

    _, fit = add_several(study, base.fit, (), CATALOGUE, 0, np.random.default_rng(0), keep)
    assert [len(names) for names in rounds] == [1, 2]
    assert {one.effect.name for one in fit.problem.effects} == set(rounds[1])


@pytest.mark.parametrize(("add_up", "rounds"), [(True, 1), (False, 2)])
def test_a_round_of_those_that_add_up_must_explain_a_quarter(small, monkeypatch, add_up, rounds):
    study, base = small
    monkeypatch.setattr(several, "_AT_ONCE", 1)
    monkeypatch.setattr(several, "_SEVERAL", 1)
    shares = itertools.chain([0.9], itertools.repeat(0.2))
    monkeypatch.setattr(Study, "explained", lambda *_: next(shares))
    found = []

    def keep(steps, fit):
        found.append(steps)
        return len(found) == 2

    straight = Screen(CATALOGUE, study) if add_up else None
    add_several(study, base.fit, (), CATALOGUE, 0, np.random.default_rng(0), keep, straight=straight)
    assert len(found) == rounds


@pytest.mark.parametrize("why_not", ["none is found", "too little is explained", "one does as well", "one does all"])
def test_otherwise_they_are_looked_for_one_by_one(small, monkeypatch, why_not):
    study, base = small
    asked, at_once_tried = [], []

    def added(study, fit, steps, *_, **__):
        at_once_tried.append(fit)
        one = [Step((), (), (), 2.0, 2.0)]
        further = {"none is found": None, "too little is explained": (one, fit)}
        return further.get(why_not, (one, fit_with([setting("force_bias")], fit.vector, study, fit)))

    def one_by_one(study, fit, screen, effects, *_, **__):
        asked.append((len(effects), [one.effect.name for one in fit.problem.effects]))
        return Step((), (), (), 1.0, 1.0)

    monkeypatch.setattr(search, "look_further", one_by_one)
    monkeypatch.setattr(at_once, "add_several", added)
    monkeypatch.setattr(
        at_once, "share_of_one", lambda *_: {"one does as well": 0.9, "one does all": 1.0}.get(why_not, 0)
    )
    monkeypatch.setattr(at_once, "share_of_all", lambda *_: 0.9)
    if why_not.startswith("one"):
        monkeypatch.setattr(at_once, "explained_share", lambda *_, **__: 1.0)
    diagnosis = search.diagnose(study.target, base, study.simulators, CATALOGUE, np.random.default_rng(0))
    assert asked[0] == (len(CATALOGUE), [])
    assert diagnosis.preferred == ()
    assert bool(at_once_tried) == (why_not != "one does all")


@pytest.mark.parametrize(
    ("one", "together", "taken"), [(0.4, 0.8, True), (0.6, 0.8, False), (0.4, 0.7, False), (0.6, 0.95, True)]
)
def test_they_need_explain_no_more_than_one_by_one_where_none_alone_explains_half(
    small, monkeypatch, one, together, taken
):
    study, base = small
    further = fit_with([setting("force_bias")], base.fit.vector, study, base.fit)
    of_all = {"add_up": True, "share_of_one": one, "share_of_alike": {}, "share_of_all": 1.0, "leaves_little": False}
    for name, said in of_all.items():
        monkeypatch.setattr(at_once, name, lambda *_, said=said: said)
    monkeypatch.setattr(at_once, "explained_share", lambda *_, **__: together)
    ended = []

    def one_round(study, fit, steps, effects, given, rng, keep, straight):
        ended.append(keep([], further))
        return [], further

    monkeypatch.setattr(at_once, "add_several", one_round)
    begun, so_far = SimpleNamespace(effects=CATALOGUE, given=0, floor=1.0, error=2.0), SimpleNamespace(all=None)
    several_at_once = at_once.AtOnce(so_far, begun, np.random.default_rng(0), lambda *_: False)
    assert several_at_once.that_add_up(study, [], base.fit, None, CATALOGUE) == taken
    assert (so_far.all[2] is further) == taken
    assert ended == [taken and one < 0.5]  # the rest is looked for one by one


@pytest.mark.parametrize(("share", "tried_together"), [(1.0, False), (0.9, True), (0.5, True)])
def test_one_that_looks_like_the_best_of_them_is_tried_if_it_does_as_well_alone(
    small, monkeypatch, share, tried_together
):
    """Its signature may promise little: it bends with its size."""
    study, base = small
    tried, together = [], []

    def one_by_one(study, fit, screen, effects, *_, anyway=False, **__):
        tried.append((list(effects), anyway))
        return Step((), (), (), 1.0, 1.0)

    def added(study, fit, steps, *_, **__):
        together.append(fit)
        return [Step((), (), (), 2.0, 2.0)], fit_with([setting("force_bias")], fit.vector, study, fit)

    monkeypatch.setattr(search, "look_further", one_by_one)
    monkeypatch.setattr(at_once, "add_several", added)
    monkeypatch.setattr(at_once, "share_of_one", lambda *_: 0.0)
    monkeypatch.setattr(at_once, "share_of_alike", lambda *_: {ACTUATOR_LAG: share})
    monkeypatch.setattr(at_once, "share_of_all", lambda *_: 0.9)
    monkeypatch.setattr(at_once, "explained_share", lambda *_, **__: 1.0)
    search.diagnose(study.target, base, study.simulators, CATALOGUE, np.random.default_rng(0))
    assert bool(together) == tried_together
    if share < 0.9:
        assert ([ACTUATOR_LAG], True) not in tried
    else:
        assert tried[0] == ([ACTUATOR_LAG], True)
        assert (len(tried[1][0]), tried[1][1]) == (len(CATALOGUE), False), "it was none, and all are tried"


def setting(name: str) -> EffectSetting:
    """An effect as it is hidden among the small ones."""
    effect, values = effect_of(name, light_gripper()), dict(size.split("=") for size in SMALL[name].split())
    return EffectSetting(effect, "", np.array([float(values.get(p.name, 0.0)) for p in effect.parameters]))


@pytest.mark.long
def test_one_of_several_effects_explains_little_and_one_that_is_alone_all(small):
    study, base = small
    every = fit_with([setting(name) for name in SMALL], base.fit.vector, study, base.fit)
    assert share_of_all(study, base.fit, every) == pytest.approx(1.0, abs=0.02)
    assert share_of_one(*at_first(study, base)) == pytest.approx(0.55, abs=0.05)
    one = fit_with([setting("coulomb_friction")], base.fit.vector, study, base.fit)
    assert share_of_all(study, base.fit, one) == pytest.approx(0.55, abs=0.05)
    assert most_gained_by_one(*at_first(study, base), least=1e9) == 0  # none promises so much, and none is fitted
    late = at_first(*study_of("force_lag time_constant_s=0.06"))
    assert share_of_one(*late) == pytest.approx(1.0, abs=0.02)
    alike = {effect.name: share for effect, share in share_of_alike(*late).items()}
    assert set(alike) == {"force_lag", "force_delay"}
    assert alike["force_lag"] == pytest.approx(1.0, abs=0.02)
    assert 0.5 < alike["force_delay"] < 0.98


def test_what_is_usual_on_few_grasps_is_no_matter_of_one_reading(small):
    study, base = small
    study = dataclasses.replace(with_few(study, base.fit), folds=())
    some, part = study.on_few(base.fit)
    usual = usual_on_few(study, base.fit)
    assert usual == pytest.approx(some.target.beyond_noise(part.residual), rel=0.3)
    residual = base.fit.residual.copy()
    residual[study.few.keep[0], 0, 0] += 60.0
    assert usual_on_few(study, dataclasses.replace(base.fit, residual=residual)) - usual < 0.8 * 60**2
    assert usual_on_few(study, dataclasses.replace(base.fit, residual=0 * residual)) == 0


def test_what_explains_next_to_nothing_is_not_needed(small):
    study, base = small
    every = fit_with([setting(name) for name in SMALL], base.fit.vector, study, base.fit)
    assert _needed(study, every, 0) is every
    fewer = _needed(study, every, 0, worth=0.1 * study.target.beyond_noise(base.fit.residual))
    assert set(SMALL) - {one.effect.name for one in fewer.problem.effects} == {"force_gain_asymmetry"}


def at_first(study, base):
    """What is asked of a base model."""
    return study, base.fit, Screen(CATALOGUE, study), CATALOGUE


def test_nothing_is_found_where_nothing_is_hidden():
    study, base = study_of()
    assert add_several(study, base.fit, (), CATALOGUE, 0, np.random.default_rng(0), kept_by_nobody) is None


@pytest.mark.long
@pytest.mark.parametrize("straight", [True, False])
@pytest.mark.parametrize("enough", [True, False])
def test_a_search_that_is_stopped_keeps_what_rounds_found_if_it_explains_enough(
    mixed, found, monkeypatch, enough, straight
):
    (study, base), (steps, fit) = mixed, found
    left_out = [step.effects[0] for step in steps[:3]]
    some = steps if enough else steps[3:]
    less = fit if enough else roughly_without(left_out, fit, study)

    def one_round(*given, **_):
        keep = given[-1]
        keep(some, less)
        raise KeyboardInterrupt

    error = study.error(study.heldout(base.fit))
    monkeypatch.setattr(search, "look_further", lambda *_, **__: Step((), (), (), error, error))
    monkeypatch.setattr(at_once, "add_up", lambda *_: straight)
    monkeypatch.setattr(at_once, "add_several", one_round)
    for name in ("exchange", "split"):
        monkeypatch.setattr(search, name, lambda *_: None)
    rng = np.random.default_rng(0)
    diagnosis = search.diagnose(study.target, base, study.simulators, CATALOGUE, rng)
    assert diagnosis.stopped
    assert set(diagnosis.preferred) == (set(HIDDEN) if enough else set())
