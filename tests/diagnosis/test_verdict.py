"""When a step takes an effect, when two can't be told apart, and what the steps amount to."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from forcegrasp.diagnosis.evidence import (
    LEAST_SHARE_OF_MANY,
    indistinguishable,
    is_significant,
    with_close_rivals,
)
from forcegrasp.diagnosis.result import Diagnosis, Step, settle_ties
from forcegrasp.diagnosis.search import search
from forcegrasp.diagnosis.search.start import Start
from forcegrasp.diagnosis.signatures import Score, _single, of_best_effects, share_together
from forcegrasp.diagnosis.verdict import conclude, explained_share, explains_enough
from forcegrasp.effects import get_effect
from forcegrasp.effects.setting import EffectSetting
from forcegrasp.identify.verdict import Verdict
from forcegrasp.reports import diagnosis_answer, diagnosis_as_json
from forcegrasp.reports.diagnosis_box import certainty
from forcegrasp.reports.diagnosis_words import left_sentence


def candidate(made_up, **changed: Any):
    """A candidate that passes each gate of a step, but for what is changed."""
    good = made_up.diagnosis("effect").steps[0].candidates[0]
    return dataclasses.replace(good, **({"p_family": 0.002, "share": 0.9, "largest_fall": 0.5} | changed))


# --- one step ------------------------------------------------------------------------------------------------------


def test_a_lag_of_which_the_integrator_makes_as_much_does_not_convince(made_up, monkeypatch):
    def lag(seconds: float):
        return EffectSetting(get_effect("velocity_lag"), "difference", np.array([seconds]))

    gripper = made_up.base.fit.problem.gripper
    assert not gripper.steps_as_its_drive
    two_steps = 2 * gripper.compile().opt.timestep
    assert is_significant(candidate(made_up, setting=lag(1.01 * two_steps)), 0.02)
    assert not is_significant(candidate(made_up, setting=lag(0.99 * two_steps)), 0.02)
    assert not indistinguishable(candidate(made_up), candidate(made_up, setting=lag(0.99 * two_steps)))
    # a drive that samples at each step differs from the integrator by its own steps
    monkeypatch.setitem(vars(gripper), "steps_as_its_drive", True)
    assert is_significant(candidate(made_up, setting=lag(0.99 * two_steps)), 0.02)


@pytest.mark.parametrize(("share", "plausible"), [(0.69, False), (0.71, True)])
def test_columns_that_are_swapped_in_part_are_not_swapped(made_up, share, plausible):
    """A share of 0.07 is crosstalk of 0.075 by another name: grasps with crosstalk were a tie with swapped columns."""
    swapped = candidate(made_up, setting=EffectSetting(get_effect("swapped_forces"), "", np.array([share])))
    crosstalk = candidate(made_up, setting=EffectSetting.typical(get_effect("force_crosstalk")))
    assert is_significant(swapped, 0.02) == plausible
    assert indistinguishable(crosstalk, swapped) == plausible
    rivals = with_close_rivals(Step(("force_crosstalk",), (crosstalk, swapped), (), 4.0, 3.0)).effects[1:]
    assert rivals == (("swapped_forces",) if plausible else ())


@pytest.mark.parametrize(
    ("changed", "taken"),
    [
        ({}, True),
        ({"share": 0.26}, True),
        ({"share": 0.24}, False),  # alone; a quarter of the mean square beyond the noise is asked for
        ({"p_family": 0.009}, True),
        ({"p_family": 0.011}, False),
        ({"largest_fall": 0.021}, True),
        ({"largest_fall": 0.019}, False),
        # four grasps' gains with standard deviation 10: their sum is uncertain by 10 √4 = 20
        ({"gains": np.array([0.0, 0.0, 10.0, 10.0]) * np.sqrt(3) - 5 * np.sqrt(3) + 5.1}, True),
        ({"gains": np.array([0.0, 0.0, 10.0, 10.0]) * np.sqrt(3) - 5 * np.sqrt(3) + 4.9}, False),
        ({"gains": np.full(4, 1.3)}, True),
        ({"gains": np.full(4, 1.2)}, False),  # a sum below 5 is no evidence, however even
        ({"gains": np.array([100.0, np.nan, np.nan, np.nan])}, False),  # one grasp has no spread
    ],
)
def test_what_convinces(made_up, changed, taken):
    gains = changed.get("gains")
    if gains is not None and len(gains) == 4 and gains.std() > 1:
        assert gains.std(ddof=1) == pytest.approx(10)
    assert is_significant(candidate(made_up, **changed), 0.02) == taken


def test_a_gain_may_have_to_be_several_of_its_standard_errors(made_up):
    gains = np.array([0.0, 0.0, 10.0, 10.0]) * np.sqrt(3) - 5 * np.sqrt(3) + 10.1  # a sum of 40.4, uncertain by 20
    assert is_significant(candidate(made_up, gains=gains), 0.02, errors=2.0)
    assert not is_significant(candidate(made_up, gains=gains), 0.02, errors=2.1)


def test_a_grasp_that_gains_far_more_than_the_others_makes_nothing_unsure_that_these_are_sure_of(made_up):
    agree = np.array([1.0, 2.0, 3.0, 2.0, 1.0, 3.0])  # a sum of 12, uncertain by 2.2

    def shown(gains: np.ndarray) -> bool:
        return is_significant(candidate(made_up, gains=gains), 0.02, errors=2.0)

    assert shown(agree)
    assert shown(np.append(agree, 300.0))
    assert shown(np.r_[np.nan, agree, 300.0])
    assert not shown(np.append(agree[:5], 300.0))  # five are too few to do without it
    assert not shown(np.r_[agree, 300.0, 300.0])  # two hold nearly all of it
    assert not shown(np.r_[agree - 2, 300.0])  # and the others gain nothing


@pytest.mark.parametrize(("ahead", "equal"), [(4.9, True), (5.1, False)])
def test_a_lead_within_its_standard_error_decides_nothing(made_up, ahead, equal):
    """Leads of four grasps with standard deviation 10: their sum is uncertain by 20."""
    lead = np.array([-5.0, -5.0, 5.0, 5.0]) * np.sqrt(3) + ahead
    assert lead.std(ddof=1) == pytest.approx(10)
    winner = candidate(made_up, gains=100 + lead, signature=np.array([1.0, 0.0]))
    other = candidate(made_up, gains=np.full(4, 100.0), signature=np.array([0.0, 1.0]))
    assert indistinguishable(winner, other) == equal


@pytest.mark.parametrize(("gain", "equal"), [(95.0, True), (89.0, False)])
def test_effects_of_parallel_signatures_are_alike_if_they_gain_alike(made_up, gain, equal):
    """A small ringing looks like a delay; fitted, it may explain what a delay can't."""
    winner = candidate(made_up, gains=np.full(4, 100.0), signature=np.array([1.0, 0.0]))
    other = candidate(made_up, gains=np.full(4, gain), signature=np.array([1.0, 0.05]))
    assert indistinguishable(winner, other) == equal


def of_name(made_up, name: str, gain: float, share: float, signature: list[float]):
    """A candidate of one effect, which each of four grasps speaks for alike."""
    setting = EffectSetting.typical(get_effect(name))
    return candidate(made_up, setting=setting, gains=np.full(4, gain), share=share, signature=np.array(signature))


@pytest.mark.parametrize(("lead", "equal"), [(9.0, True), (11.0, False)])
def test_between_a_fault_of_the_set_and_an_effect_a_small_lead_decides_nothing(made_up, lead, equal):
    winner = of_name(made_up, "backlash", 100 + lead / 4, 0.99, [1.0, 0.0])
    other = of_name(made_up, "object_size", 100.0, 0.97, [0.0, 1.0])
    assert indistinguishable(winner, other) == equal
    assert not indistinguishable(winner, of_name(made_up, "encoder_bias", 100.0, 0.97, [0.0, 1.0]))


@pytest.mark.parametrize(
    ("share", "gain", "others", "equal"),
    [
        (0.79, 920.0, 0.73, True),  # both leave much: what is not known yet may decide between them
        (0.99, 920.0, 0.95, False),  # one leaves next to nothing, the other five times as much
        (0.79, 850.0, 0.73, False),  # it gains too little
    ],
)
def test_nor_does_a_larger_lead_where_both_leave_much(made_up, share, gain, others, equal):
    winner = of_name(made_up, "backlash", 1000.0, share, [1.0, 0.0])
    assert indistinguishable(winner, of_name(made_up, "object_size", gain, others, [0.0, 1.0])) == equal
    assert not indistinguishable(winner, of_name(made_up, "stiction", gain, others, [0.0, 1.0]))


def test_what_explains_too_little_yet_hides_nothing_that_explains_enough(made_up):
    """Of several hidden effects the one that gains most may explain less than a quarter of all."""
    ahead = candidate(made_up, gains=np.full(4, 110.0), share=0.2)
    enough = candidate(made_up, gains=np.full(4, 100.0), share=0.6)
    less = candidate(made_up, gains=np.full(4, 50.0), share=0.6)
    start = object.__new__(Start)
    start.least_gain, start._least_errors = 0.02, 1.0
    assert sorted([ahead, less, enough], key=start.place) == [enough, less, ahead]


def test_one_of_many_may_explain_less(made_up):
    little = candidate(made_up, share=0.12)
    assert not is_significant(little, 0.02)
    assert is_significant(little, 0.02, LEAST_SHARE_OF_MANY)
    assert not is_significant(candidate(made_up, share=0.09), 0.02, LEAST_SHARE_OF_MANY)


@pytest.mark.parametrize(
    ("before", "after", "left", "believed"),
    [(3.0, 1.0, "", True), (3.0, 1.2, "much", True), (3.0, 2.0, "much", False), (3.0, 2.9, "", True)],
)
def test_what_explains_little_is_believed_together(monkeypatch, before, after, left, believed):
    """Three quarters of the mean square beyond the noise, or all that is no noise."""

    def study(error: float):
        return SimpleNamespace(heldout=lambda fit: error, error=lambda held: held)

    monkeypatch.setattr(search, "left_over", lambda study, fit: (left, None))
    one, other = cast(Any, study(before)), cast(Any, study(after))
    assert search._convincing(one, cast(Any, None), other, cast(Any, None)) == believed


def test_where_much_is_left_what_gains_nearly_as_much_is_a_rival(made_up):
    def gaining(name: str, gain: float, cost: float = 1.0, error: float = 2.1):
        setting, residual = EffectSetting.typical(get_effect(name)), np.full((1, 1, 1), cost**0.5)
        fit = dataclasses.replace(candidate(made_up).fit, residual=residual, weight=np.ones((1, 1, 1)))
        return candidate(made_up, setting=setting, gains=np.full(4, gain / 4), fit=fit, error_after=error)

    others = [gaining("stiction", 89), gaining("rate_limit", 95), gaining("presliding", 99, 2.0)]
    others.append(gaining("command_delay", 20, error=1.9))  # leaves less, though it gains less
    step = Step(("backlash",), (gaining("backlash", 100, error=2.0), *others), (), 5.0, 2.0)
    named = with_close_rivals(step)
    assert named.effects == ("backlash", "rate_limit", "command_delay")
    assert [c.effect.name for c in named.candidates] == [*named.effects, "stiction", "presliding"]
    nested = Step(("coulomb_friction",), (gaining("coulomb_friction", 100), gaining("stiction", 101)), (), 5.0, 2.0)
    assert with_close_rivals(nested) == nested
    nothing = Step((), step.candidates, (), 5.0, 5.0)
    assert with_close_rivals(nothing) == nothing


@pytest.mark.parametrize(("share", "winners", "equal"), [(0.2, 0.6, False), (0.26, 0.6, True), (0.2, 0.3, True)])
def test_what_explains_far_less_is_no_rival(made_up, share, winners, equal):
    winner = candidate(made_up, gains=np.full(4, 100.0), share=winners, signature=np.array([1.0, 0.0]))
    other = candidate(made_up, gains=np.full(4, 101.0), share=share, signature=np.array([0.0, 1.0]))
    assert indistinguishable(winner, other) == equal


@pytest.mark.parametrize(("share", "equal"), [(1.1, True), (1.3, False)])
def test_what_fits_all_grasps_far_worse_is_no_rival(made_up, share, equal):
    """Where few grasps tell of an object, what is left of one that was held out says little."""
    winner = candidate(made_up, gains=np.array([400.0, 0.0, 0.0, 0.0]), signature=np.array([1.0, 0.0]))
    worse = dataclasses.replace(winner.fit, residual=share * winner.fit.residual)
    other = candidate(made_up, gains=np.full(4, 90.0), signature=np.array([0.0, 1.0]), fit=worse)
    assert indistinguishable(winner, other) == equal


def test_signatures_explain_together_what_lies_in_their_span():
    rng = np.random.default_rng(0)
    one, other, unknown = np.linalg.qr(rng.normal(size=(200, 3)))[0].T
    residual = 30 * one - 20 * other + 10 * unknown
    fit = cast(Any, SimpleNamespace(weight=np.ones(1), residual=residual))
    scores = [cast(Any, SimpleNamespace(signature=s)) for s in (one, other, one)]  # twice the same adds nothing
    assert share_together(scores, fit, 1400.0) == pytest.approx(1300 / 1400)


def test_a_rival_that_is_found_besides_is_none():
    steps = [Step(names, (), (), 3.0, 2.0) for names in (("a", "b", "c"), ("b",), ())]
    assert [step.effects for step in settle_ties(steps)] == [("a", "c"), ("b",), ()]


# --- all steps -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("found", "before", "after", "left", "verdict"),
    [
        ([], 1.0, 1.0, False, "explained"),
        ([], 3.0, 3.0, True, "unknown"),
        (["effect"], 5.0, 1.0, False, "effect"),
        (["one_of"], 5.0, 1.0, False, "one_of"),
        (["one_of", "effect"], 5.0, 1.0, False, "one_of"),
        (["effect", "one_of", "effect"], 5.0, 1.0, False, "one_of"),
        (["effect", "effect"], 8.0, 1.68, True, "effect"),  # 97 % explained
        (["effect"], 348.0, 173.0, True, "unknown"),  # 75 % explained, and 173 × noise is left
        (["effect"], 5.1, 3.09, True, "unknown"),
        (["one_of"], 5.1, 3.09, True, "unknown"),
        (["effect"], 50.0, 5.0, True, "effect"),  # 99 % explained: right, if not all
        (["effect"], 3.0, 1.6, True, "effect"),
        (["effect"], 2.0, 1.7, True, "unknown"),  # 37 % explained
        (["effect"], 1.2, 1.19, False, "effect"),
    ],
)
def test_the_verdict(found, before, after, left, verdict):
    share = explained_share(before, after)
    assert conclude([Verdict(step) for step in found], share, after, 1.0, left) == verdict


def test_of_motions_held_out_as_wholes_half_of_the_error_is_enough():
    found = [Verdict.EFFECT]
    assert conclude(found, 0.75, 5.0, 1.0, left=True) is Verdict.UNKNOWN
    assert conclude(found, 0.75, 5.0, 1.0, left=True, whole_recordings=True) is Verdict.EFFECT
    assert conclude(found, 0.4, 8.0, 1.0, left=True, whole_recordings=True) is Verdict.UNKNOWN


def test_where_no_effect_explains_half_all_together_must_explain_more():
    assert explains_enough(0.7, 1.4, 1.0, False, largest=0.6)
    assert not explains_enough(0.7, 1.4, 1.0, False, largest=0.4)
    assert explains_enough(0.85, 1.4, 1.0, False, largest=0.4)
    assert explains_enough(0.7, 1.4, 1.0, True, largest=0.4)
    assert conclude([Verdict.EFFECT] * 2, 0.7, 1.4, 1.0, left=True, largest=0.4) is Verdict.UNKNOWN
    assert conclude([Verdict.EFFECT] * 2, 0.7, 1.4, 1.0, left=False, largest=0.4) is Verdict.EFFECT


def test_shares_are_of_the_mean_square_beyond_the_noise():
    assert explained_share(3.0, 2.0) == pytest.approx(5 / 8)
    assert explained_share(5.0, 3.0, noise=3.0) == pytest.approx(1.0)


# --- what is said of them ------------------------------------------------------------------------------------------


def two_steps(made_up, rivals: tuple[str, ...] = ("coulomb_friction", "stiction"), **changed: Any) -> Diagnosis:
    """Two effects found, the first with rivals that these data can't tell from it."""
    one = made_up.diagnosis("one_of")
    first = [
        dataclasses.replace(one.steps[0].candidates[0], setting=EffectSetting.typical(get_effect(name)))
        for name in rivals
    ]
    steps = (
        Step(rivals, tuple(first), (), 5.0, 2.0),
        Step(("force_bias",), one.steps[0].candidates[:1], (), 2.0, 1.0),
    )
    names = (rivals[0], "force_bias", *rivals[1:])
    figures = {"error_before": 5.0, "error_after": 1.0, "floor": 1.02, "left": ""} | changed
    return dataclasses.replace(one, effects=names, steps=steps, **figures)


def test_the_headline_is_no_stronger_than_its_steps(made_up):
    diagnosis = two_steps(made_up)
    first = diagnosis_answer.answer(diagnosis).partition(". ")[0]
    assert first == (
        "The model lacks coulomb_friction (or stiction: these data can't tell which, and coulomb_friction is preferred,"
        " for it has fewer parameters) and force_bias"
    )
    found = diagnosis_as_json.diagnosis_json(diagnosis, None, made_up.tried, "s")
    assert (found["verdict"], found["effects"]) == ("one_of", ["coulomb_friction", "force_bias", "stiction"])
    assert found["preferred"] == ["coulomb_friction", "force_bias"]
    assert [step["preferred_because"] for step in found["steps"]] == ["it has fewer parameters", ""]


def test_of_equally_many_parameters_the_gain_decides(made_up):
    answer = diagnosis_answer.answer(made_up.diagnosis("one_of"))
    assert "force_bias or force_drift: these data can't tell which, and force_bias is preferred" in answer
    assert "for its held-out gain is larger" in answer


def test_what_gains_less_is_preferred_for_how_it_fits_all_grasps(made_up):
    diagnosis = made_up.diagnosis("one_of")
    (step,) = diagnosis.steps
    first, *others = step.candidates
    less = dataclasses.replace(first, gains=0.5 * others[0].gains)
    step = dataclasses.replace(step, candidates=(less, *others))
    answer = diagnosis_answer.answer(dataclasses.replace(diagnosis, steps=(step,)))
    assert "force_bias is preferred, for it fits all grasps better" in answer


@pytest.mark.parametrize(
    ("before", "after", "left", "said"),
    [
        (5.0, 1.0, "", ""),
        (5.0, 1.2, "forces, hold", ""),
        (5.0, 1.3, "in all", "Not all is found: 1.30 × the sensor noise is left on held-out grasps where 1.02"),
        (5.0, 1.6, "in all", "Not all is found: 1.60 × the sensor noise is left on held-out grasps where 1.02"),
        (1.5, 1.2, "in all", "(65% of the mean square beyond it is explained)"),
    ],
)
def test_much_that_is_left_is_said_first(made_up, before, after, left, said):
    diagnosis = two_steps(made_up, error_before=before, error_after=after, left=left)
    first = diagnosis_answer.answer(diagnosis).partition(". ")[0]
    assert said in first
    assert first.startswith("Not all" if said else "The model lacks")


def test_what_the_model_found_cant_foretell_itself_may_be_all_that_is_left(made_up):
    """Half the physics step moves its predictions by as much as is left, in directions that no parameter follows."""
    shaken = np.zeros((2, *made_up.base.fit.residual.shape))
    shaken[:, :, ::2] = np.where(made_up.target.mask[:, ::2, None], 1.0, 0.0)
    for size, said in ((0.1, "Not all is found: 1.60 ×"), (2.0, "Perhaps not all is found: 1.60 ×")):
        diagnosis = two_steps(made_up, error_after=1.6, left="in all", numerical=tuple(size * shaken))
        answer = diagnosis_answer.answer(diagnosis)
        assert answer.startswith(said)
        assert ("may not foretell any better" in answer) == (size == 2.0)
        assert ("a moment early or late" in left_sentence(diagnosis)) == (size == 2.0)
        alone = dataclasses.replace(diagnosis, steps=diagnosis.steps[1:], effects=("force_bias",))
        assert certainty(alone).endswith(f"But {'perhaps ' if size == 2.0 else ''}not all is found.")


def test_a_set_that_seems_wrong_and_leaves_much_says_so_first(made_up):
    """Objects that were all too large left 1.2 × noise; in truth the encoders read by a wrong scale."""
    diagnosis = two_steps(made_up, verdict=Verdict.DATA, error_after=1.6, left="in all")
    assert diagnosis_answer.answer(diagnosis).startswith("Not all is found: 1.60 ×")
    assert "Not the model but the set seems to be wrong" in diagnosis_answer.answer(diagnosis)


@pytest.mark.parametrize(("error", "said"), [(3.0, "Sure that something is missing"), (1.1, "Something small seems")])
def test_how_sure_it_is_that_something_is_missing_goes_by_the_error(made_up, error, said):
    diagnosis = two_steps(made_up, verdict=Verdict.UNKNOWN, error_before=error, error_after=error, left="in all")
    assert certainty(diagnosis).startswith(said)
    assert ("recorded twice" in certainty(diagnosis)) == (error < 2)


def test_little_explained_is_unknown_and_says_what_it_would_take_off(made_up):
    diagnosis = two_steps(made_up, verdict=Verdict.UNKNOWN, error_before=348.0, error_after=173.0, left="in all")
    first = diagnosis_answer.answer(diagnosis).partition(". ")[0]
    assert "none of the effects I know" in first
    assert "348.00 × the sensor noise, and coulomb_friction and force_bias would only take it down to 173.00 ×" in first


# --- what is fitted ------------------------------------------------------------------------------------------------


def test_variants_do_not_crowd_out_other_effects():
    """Three effects are fitted, with as many of their variants as come before a fourth effect or after it."""
    kinds = [("backlash", "play"), ("backlash", "loose"), ("stiction", ""), ("force_lag", ""), ("force_bias", ""),
             ("backlash", "command")]  # fmt: skip
    scores = [Score(EffectSetting.typical(get_effect(name), variant), 1.0, np.ones(1)) for name, variant in kinds]
    assert [score.setting.kind[0].name for score in of_best_effects(scores, 3)] == [
        "backlash", "backlash", "stiction", "force_lag", "backlash",
    ]  # fmt: skip


def test_only_what_may_be_negative_is_promised_with_that_sign():
    """A contact may stiffen less than the scene's; a spring beside it never pulls."""
    curve, spring = (
        EffectSetting(get_effect("stiffening_contact"), "", np.array(values))
        for values in ((0.5, 0.0, 3.0), (0.0, 0.04, 3.0))
    )
    change = np.ones(4)
    less, pulling = (_single(change, change, -change, one) for one in (curve, spring))
    assert less is not None
    assert pulling is not None
    assert (less.gain, less.setting.values[0]) == (4.0, -0.5)
    assert pulling.gain == 0.0
