"""Noise that is not what was said is told from effects that nobody knows."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

from forcegrasp.diagnosis.noise.noise_check import Noise, is_uneven_noise, unexpected_noise
from forcegrasp.diagnosis.search.left_over import (
    has_tails_alone,
    is_worth_looking,
    left_by_many,
    left_over,
    may_lack_something,
)
from forcegrasp.diagnosis.signatures import Score, null_gains
from forcegrasp.effects import get_effect
from forcegrasp.effects.setting import EffectSetting
from forcegrasp.identify.noise_floor import excess
from forcegrasp.identify.phases import PHASES
from forcegrasp.identify.target import Target
from forcegrasp.measure import MeasuredGrasp
from forcegrasp.physics.gripper_file import load_gripper
from forcegrasp.reports import diagnosis_answer, diagnosis_as_json
from forcegrasp.reports.next_step import after_diagnosis

G, S, MANY = 8, 150, 24
TIAGO = load_gripper("tiago")
ONES = np.ones(4)
NOTHING = (np.zeros((G, S, 4)),) * 2
PHASE = np.arange(S) * len(PHASES) // S
#: In each phase the fingers move half of the time; forces rise and fall.
MOVING = np.arange(S) // 15 % 2 == 0
FORCE = np.interp(np.arange(S), [0, 40, 80, 110, 150], [0.0, 0.0, 1.0, 1.0, 0.0])
GRASPS = np.tile(np.stack([np.cumsum(MOVING), np.cumsum(MOVING), FORCE, FORCE], axis=1), (G, 1, 1))


def make(count: int = G) -> Target:
    """A target whose grasps pass through all phases; noise 1 in every signal."""
    pair, mask = np.zeros((S, 2)), np.ones((count, S), bool)
    grasps = tuple(
        MeasuredGrasp(f"g{i}", "cup", "", 0.02, 0.0, None, np.arange(S) * 0.04, pair, pair, pair, None)
        for i in range(count)
    )
    return Target(
        grasps,
        np.zeros((count, S, 4)),
        mask,
        ONES,
        ONES,
        0 * ONES,
        True,
        np.tile(PHASE, (count, 1)),
        TIAGO,
        np.ones((count, 1, 1)),
    )


def normal(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal((G, S, 4))


def student(seed: int) -> np.ndarray:
    """Three degrees of freedom: standard deviation √3."""
    return np.random.default_rng(seed).standard_t(3, (G, S, 4))


@pytest.mark.parametrize("seed", range(5))
def test_noise_as_said_is_no_finding(seed):
    assert unexpected_noise(normal(seed), NOTHING, make(), GRASPS) is None


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("times", [1.3, 3.0])
def test_noise_of_another_size(times, seed):
    noise = unexpected_noise(times * normal(seed), NOTHING, make(), GRASPS)
    assert noise is not None
    assert noise.affected.all()
    assert noise.ratio == pytest.approx(times, rel=0.05)
    assert noise.core == pytest.approx(times, rel=0.15)
    assert noise.stronger
    assert not noise.heavy_tails.any()


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("scale", [1.0, 1 / np.sqrt(3)])
def test_heavy_tails(scale, seed):
    noise = unexpected_noise(scale * student(seed), NOTHING, make(), GRASPS)
    assert noise is not None
    assert noise.heavy_tails.all()
    assert noise.stronger
    assert noise.core == pytest.approx(1.134 * scale, rel=0.1)  # 0.765 ÷ 0.6745, the medians of the two


@pytest.mark.parametrize("seed", range(5))
def test_few_outliers_everywhere(seed):
    """A phase of few samples that has none of them is no sign of noise as it was said."""
    rng = np.random.default_rng(seed)
    residual = rng.standard_normal((MANY, S, 4)) * np.where(rng.random((MANY, S, 4)) < 1 / 300, 8.0, 1.0)
    nothing = (0 * residual,) * 2
    assert excess(residual, nothing, make(MANY))
    noise = unexpected_noise(residual, nothing, make(MANY), np.tile(GRASPS[:1], (MANY, 1, 1)))
    assert noise is not None
    assert noise.stronger


def test_noise_of_one_signal():
    residual = normal(0) * [1, 1, 1, 3]
    noise = unexpected_noise(residual, NOTHING, make(), GRASPS)
    assert noise is not None
    assert noise.affected.tolist() == [False, False, False, True]
    assert noise.ratio[3] == pytest.approx(3, rel=0.05)


def test_noise_that_is_smaller():
    noise = unexpected_noise(normal(0) * [1, 1, 0.3, 0.3], NOTHING, make(), GRASPS)
    assert noise is not None
    assert (noise.affected.tolist(), noise.stronger) == ([False, False, True, True], False)


def test_grasps_that_were_not_held_out_are_left_out():
    residual = 3 * normal(0)
    residual[5:] = np.nan
    noise = unexpected_noise(residual, NOTHING, make(), GRASPS)
    assert noise is not None
    assert noise.ratio == pytest.approx(3, rel=0.07)


def level(residual):
    residual[:, PHASE == 3, 2] += 1.5
    return residual


def louder_in_one_phase(residual):
    residual[:, PHASE == 4] *= 3
    return residual


def louder_when_pressed(residual):
    residual[:, PHASE >= 2] *= 1.5
    return residual


def wild_while_moving(residual):
    """White in time, rare and large: readings that are stale matter where things move."""
    wild = np.random.default_rng(9).random((G, S, 4)) < 0.05
    wild[:, PHASE == 3] = False
    residual[wild] *= 20
    return residual


def louder_with_the_force(residual):
    return residual * np.sqrt(1 + 8 * FORCE)[:, None]


def twice_and_more_in_motion(residual):
    """No phase and no speed is as was said."""
    return 2 * residual * np.where(MOVING, 2, 1)[:, None]


def wild_in_motion(residual):
    """As when some readings are the one of the sample before: that shows only in motion."""
    wild = np.random.default_rng(9).random((G, S, 4)) < 0.04
    return np.where(wild & MOVING[:, None], 20 * residual, residual)


def wave(residual):
    return residual + 2 * np.sin(2 * np.pi * np.arange(S) / 4)[:, None]


def slow(residual, memory=0.7):
    """Each reading leans on the one before, as behind a filter."""
    out = residual.copy()
    for k in range(1, residual.shape[1]):
        out[:, k] += memory * out[:, k - 1]
    return out


def slow_and_a_law(residual):
    return slow(residual) + 3 * FORCE[:, None]


def slow_and_the_same_in_every_grasp(residual):
    return np.tile(slow(residual)[:1], (G, 1, 1)) + 0.5 * residual


def slow_where_pressed(residual):
    return np.where((PHASE >= 2)[:, None], slow(residual), 2 * residual)


def too_slow(residual):
    return slow(residual, 0.99)


def slow_and_too_large(residual):
    """As a lag of a servo leaves it, which repeats no motion."""
    return 3.2 * slow(residual)


@pytest.mark.parametrize("seed", range(3))
def test_slow_noise(seed):
    """It is new in every grasp, and nothing foretells it."""
    residual = np.concatenate([3 * normal(seed)[..., :3], slow(normal(seed))[..., 3:]], axis=-1)
    noise = unexpected_noise(residual, NOTHING, make(), GRASPS)
    assert noise is not None
    assert noise.memory[:3].tolist() == [0, 0, 0]
    assert noise.memory[3] * noise.slow_share[3] == pytest.approx(0.7, abs=0.05)
    assert noise.ratio == pytest.approx([3, 3, 3, 1.4], rel=0.1)
    assert noise.stronger


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("memory", "slow_std"), [(0.8, 0.8), (0.9, 0.7), (0.9, 1.5), (0.95, 0.8)])
def test_slow_noise_beside_white(memory, slow_std, seed):
    rng = np.random.default_rng(seed)
    white, wandering = rng.standard_normal((2, MANY, S + 100, 4))
    residual = (white + slow_std * np.sqrt(1 - memory**2) * slow(wandering, memory))[:, 100:]
    nothing = (0 * residual,) * 2
    assert excess(residual, nothing, make(MANY))
    noise = unexpected_noise(residual, nothing, make(MANY), np.tile(GRASPS[:1], (MANY, 1, 1)))
    assert noise is not None
    assert noise.memory == pytest.approx(memory, abs=0.08)
    assert noise.slow_share == pytest.approx(slow_std**2 / (1 + slow_std**2), abs=0.12)


def test_chance_gains_more_where_noise_is_slow():
    """The sum of many readings, as of an offset, scatters by as much as the noise's sum does."""
    signature = np.zeros((G, S, 4))
    signature[..., 3] = 1 / np.sqrt(G * S)
    scores = [[Score(EffectSetting.typical(get_effect("force_bias")), 1.0, signature.ravel())]]
    memory = np.array([0.9, 0.0, 0.0, 0.6])
    slow = (memory, np.ones(4), S)
    white, as_is = (null_gains(scores, np.random.default_rng(0), 4000, slow=s) for s in (None, slow))
    assert as_is.mean() / white.mean() == pytest.approx(1.6 / 0.4, rel=0.05)


def kicked_where_motion_begins_and_ends(residual: np.ndarray) -> np.ndarray:
    """As by the mass of a fingertip, which its sensor feels: of a few readings, and no larger than tails are."""
    kicks = np.diff(MOVING.astype(float), prepend=0.0)[:, None] * [0, 0, 3.5, 3.5]
    return residual + kicks


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    "spoil",
    [
        kicked_where_motion_begins_and_ends,
        level,
        louder_in_one_phase,
        louder_when_pressed,
        wild_while_moving,
        wild_in_motion,
        twice_and_more_in_motion,
        louder_with_the_force,
        wave,
        slow_and_a_law,
        slow_and_the_same_in_every_grasp,
        slow_where_pressed,
        too_slow,
        slow_and_too_large,
    ],
)
def test_an_effect_is_not_taken_for_noise(spoil, seed):
    residual = spoil(normal(seed))
    assert excess(residual, NOTHING, make())
    assert unexpected_noise(residual, NOTHING, make(), GRASPS) is None


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    ("spoil", "uneven"),
    [
        (louder_in_one_phase, True),
        (louder_when_pressed, True),
        (louder_with_the_force, True),
        (twice_and_more_in_motion, True),
        (level, False),
        (wave, False),
        (slow, False),
        (slow_and_a_law, False),
        (slow_where_pressed, False),
        (too_slow, False),
    ],
)
def test_noise_that_grows_with_the_state_is_told_from_a_law(spoil, uneven, seed):
    assert is_uneven_noise(spoil(normal(seed)), NOTHING, make(), GRASPS) is uneven


def test_in_doubt_it_is_not_noise():
    """One grasp of 150 samples does not show where so small an excess is from."""
    target, nothing = make(1), tuple(n[:1] for n in NOTHING)
    assert excess(1.2 * normal(0)[:1], nothing, target)
    assert unexpected_noise(1.2 * normal(0)[:1], nothing, target, GRASPS[:1]) is None


@pytest.mark.parametrize(("channel", "times"), [(3, 9.0), (0, 1.0)])
def test_chance_gains_as_much_as_the_noise_that_there_is(channel, times):
    """Three times the noise in one signal is nine times the gain by chance of an effect that shows there."""
    signature = np.zeros((G, S, 4))
    signature[..., channel] = 1 / np.sqrt(G * S)
    scores = [[Score(EffectSetting.typical(get_effect("force_bias")), 1.0, signature.ravel())]]
    as_said, as_is = (
        null_gains(scores, np.random.default_rng(0), noise=noise) for noise in (None, np.array([1.0, 1.0, 1.0, 3.0]))
    )
    assert as_is == pytest.approx(times * as_said, rel=1e-3)


# --- in words ------------------------------------------------------------------------------------------------------


def of(made_up, verdict: str, times: list[float], core: list[float], unlike: list[bool], memory=None, **changed):
    noise = Noise(np.array(times), np.array(core), np.array(unlike), np.array(memory or [0.0] * 4), np.ones(4))
    return dataclasses.replace(made_up.diagnosis(verdict), noise=noise, left="", **changed)


def test_the_answer_tells_the_noise(made_up):
    diagnosis = of(made_up, "explained", [3.0, 3.1, 1.0, 1.7], [3.0, 3.1, 1.0, 1.1], [True, True, False, True])
    answer = diagnosis_answer.answer(diagnosis)
    assert answer.startswith("The model explains these data: they show no missing effect")
    assert (
        "positions scatter by 3.1 ×, force right scatter by 1.7 × (with heavy tails) the noise that was given" in answer
    )
    assert "white in time and alike in all phases" in answer
    assert "give position_std_m and force_std_n" in answer
    assert "none of the effects" not in answer
    found = diagnosis_as_json.diagnosis_json(diagnosis, None, made_up.tried, "s")
    assert set(found["noise"]) == {"position_l", "position_r", "force_r"}
    assert found["noise"]["force_r"] == {
        "times_stated": 1.7,
        "core": 1.1,
        "heavy_tails": True,
        "memory": 0.0,
        "slow_share": 1.0,
    }
    assert found["where"]["explainable"] == 0


@pytest.mark.parametrize(("times", "tails_alone"), [(0.97, True), (1.2, False)])
def test_noise_of_the_given_size_with_heavy_tails_is_not_to_be_given_anew(made_up, times, tails_alone):
    diagnosis = of(made_up, "explained", [times, 1.0, 1.0, 1.0], [0.7] * 4, [True, False, False, False])
    answer, commands = (
        diagnosis_answer.answer(diagnosis),
        after_diagnosis(diagnosis, None, "s", "known.yaml", "found.yaml"),
    )
    assert ("the noise of position left has heavy tails, and the size that was given" in answer) == tails_alone
    assert ("To do: give position_std_m" in answer) != tails_alone
    assert any("give the noise" in command.purpose for command in commands) != tails_alone


def test_noise_that_is_slow_in_part_is_called_so(made_up):
    diagnosis = of(made_up, "explained", [2.0] * 4, [2.0] * 4, [True] * 4, [0.0, 0.0, 0.9, 0.9])
    diagnosis.noise.slow_share[:] = 0.3
    assert "in part slow, as behind a filter (force left, force right)" in diagnosis_answer.answer(diagnosis)


def test_slow_noise_is_called_so(made_up):
    diagnosis = of(made_up, "explained", [2.0] * 4, [2.0] * 4, [True] * 4, [0.0, 0.0, 0.7, 0.6])
    assert "slow, as behind a filter (force left, force right)" in diagnosis_answer.answer(diagnosis)


def test_an_effect_and_other_noise(made_up):
    diagnosis = of(made_up, "effect", [3.0] * 4, [3.0] * 4, [True] * 4, error_before=5.0, error_after=3.0)
    answer = diagnosis_answer.answer(diagnosis)
    assert answer.startswith("The model lacks force_bias. ")
    assert "positions scatter by 3 ×, forces scatter by 3 ×" in answer
    assert diagnosis.explained == pytest.approx(1)


def test_a_noise_that_is_smaller_may_hide_effects(made_up):
    answer = diagnosis_answer.answer(
        of(made_up, "explained", [1, 1, 0.3, 0.3], [1, 1, 0.3, 0.3], [False] * 2 + [True] * 2)
    )
    assert "the noise is smaller than that: forces scatter by 0.3 ×" in answer
    assert "a small effect may show" in answer


def test_noise_as_said_is_not_mentioned(made_up):
    diagnosis = made_up.diagnosis("explained")
    assert "white in time" not in diagnosis_answer.answer(diagnosis)
    assert diagnosis_as_json.diagnosis_json(diagnosis, None, made_up.tried, "s")["noise"] is None


@pytest.mark.parametrize(("grasps", "of_many"), [(1, False), (2, True)])
def test_what_one_grasp_alone_shows_is_told_and_is_no_missing_effect(grasps, of_many, made_up):
    """Fingers push an object here or there by chance; two grasps of many show what the model lacks."""
    held = np.random.default_rng(0).standard_normal((MANY, S, 4))
    held[:grasps, 40:60, 0] += 8.0
    fit = SimpleNamespace(residual=held, predicted=np.tile(GRASPS[:1], (MANY, 1, 1)))
    study = SimpleNamespace(target=make(MANY), numerical=(0 * held,) * 2, heldout=lambda _: held.copy())
    left, noise, alone = left_by_many(study, fit)
    assert (bool(left), noise, bool(alone)) == (of_many, None, not of_many)
    told = dataclasses.replace(made_up.diagnosis("explained"), alone=alone)
    assert ("Only grasp g0 of cup (" in diagnosis_answer.answer(told)) is not of_many


@pytest.mark.parametrize(("fitted", "told"), [(normal(0), None), (student(0), True), (0.5 * normal(0), False)])
def test_only_what_a_fit_of_all_grasps_leaves_can_be_more_noise(fitted, told):
    """A grasp that goes another way once it is held out scatters, and is no noise; less noise shows in both."""
    held = 0.5 * normal(0) if told is False else student(0)
    fit = SimpleNamespace(residual=fitted, predicted=GRASPS)
    study = SimpleNamespace(target=make(), numerical=NOTHING, heldout=lambda _: held)
    left, noise = left_over(study, fit)
    assert (left, noise and noise.stronger) == ("", told)


@pytest.mark.parametrize(("times", "alone"), [(0.99, True), (1.03, False)])
def test_heavy_tails_of_noise_as_large_as_said_are_no_reason_to_look_for_an_effect(times, alone):
    """An effect takes a hundredth of it, which may as well be of its tails."""
    tails = np.random.default_rng(0).standard_t(4, (MANY, S, 4))
    held = times * tails / np.sqrt(np.mean(tails**2, axis=(0, 1)))
    fit = SimpleNamespace(residual=held, predicted=np.tile(GRASPS[:1], (MANY, 1, 1)))
    error = float(np.sqrt(np.mean(held**2)))
    study = SimpleNamespace(
        target=make(MANY), numerical=(0 * held,) * 2, heldout=lambda _: held.copy(), error=lambda _: error
    )
    left, noise = left_over(study, fit)
    assert not left
    assert noise is not None
    assert noise.has_tails_alone
    assert has_tails_alone(study, fit, noise) is alone
    assert is_worth_looking(study, fit) is not alone


@pytest.mark.parametrize(("off", "worth_it"), [(0.1, False), (0.0, True)])
def test_below_the_error_of_the_simulation_no_effect_is_looked_for(off, worth_it):
    """On a rig of another hand, with noise that leans on the reading before, a limit of force took 1.04 to 1.02."""
    held = normal(0)
    study = SimpleNamespace(
        target=make(), numerical=(0 * held + off,) * 2, heldout=lambda _: held, error=lambda _: 1.02
    )
    fit = SimpleNamespace(residual=held, predicted=GRASPS)
    assert left_over(study, fit) == ("", None)
    assert may_lack_something(study, fit) is worth_it


def test_noise_of_another_size_is_no_matter_of_tails():
    study = SimpleNamespace(target=make(), numerical=NOTHING, heldout=lambda _: normal(0), error=lambda _: 1.0)
    for tails in (True, False):
        assert has_tails_alone(study, None, SimpleNamespace(has_tails_alone=tails)) is tails
