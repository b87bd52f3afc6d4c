"""What counts as evidence apart: grasps, or a servo's recordings."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

from forcegrasp.diagnosis.evidence import indistinguishable, is_significant
from forcegrasp.diagnosis.study import Study
from forcegrasp.diagnosis.verdict import explained_share
from forcegrasp.identify.cross_validation import evidence_folds, make_folds


def study(recordings: dict[str, np.ndarray]) -> Study:
    """Of five windows with two readings each, weighed by what a model leaves that is of no account here."""
    target = SimpleNamespace(recordings=recordings, weight=np.full((5, 1, 1), 0.1), mask=np.ones((5, 2), bool))
    return Study(target, None, ())  # pyright: ignore[reportArgumentType]


def residuals(sizes: list[float]) -> np.ndarray:
    """Of windows with two readings each, ``(G, 2, 1)``."""
    return np.array(sizes)[:, None, None] * np.ones((len(sizes), 2, 1))


def test_windows_of_a_recording_are_told_together_where_three_are_held_out():
    four = {"a": np.array([0, 1]), "b": np.array([2]), "c": np.array([3]), "not held out": np.array([4])}
    before, after = residuals([3, 2, 4, 1, np.nan]), residuals([1, 2, 2, 1, np.nan])
    gains = study(four).gains(before, after)
    of_a, of_b, of_c = study(four).of_recordings(gains)
    # the log-likelihood of errors of unknown size: readings times the logarithm of how much smaller they are
    assert of_a.sum() == pytest.approx(4 * np.log(np.sqrt(6.5 / 2.5)))
    assert of_a[0] > 0 > of_a[1]  # which is as it was, where the other one is better
    assert [*of_b, *of_c] == pytest.approx([2 * np.log(2), 0])
    assert np.isnan(gains[4])
    del four["c"]  # two are too few to scatter
    assert study(four).of_recordings(gains) == []
    assert study({}).of_recordings(gains) == []
    np.testing.assert_allclose(study({}).gains(before, after), [8, 0, 12, 0, np.nan])  # of grasps the noise is known


def test_what_was_missed_by_far_may_come_near_at_the_cost_of_what_was_not():
    """By the sizes of what is left before, the second recording would lose more than the first could ever gain."""
    gains = study({"fast": np.array([0, 1]), "slow": np.array([2, 3, 4])}).gains(
        residuals([60, 60, 3, 3, 3]), residuals([2, 2, 6, 6, 6])
    )
    assert gains.sum() == pytest.approx(4 * np.log(30) - 6 * np.log(2))
    assert gains[2:].sum() < 0


def marked(splits: dict[str, str], recordings: dict[str, np.ndarray]) -> Study:
    """A study of windows with two readings each, whose recordings are marked so."""
    count = sum(map(len, recordings.values()))
    grasps = [SimpleNamespace(split=splits.get(n, ""), object="", session=n) for n, m in recordings.items() for _ in m]
    target = SimpleNamespace(recordings=recordings, grasps=grasps, mask=np.ones((count, 2), bool))
    return Study(target, None, ())  # pyright: ignore[reportArgumentType]


def test_a_motion_that_shows_something_else_hides_no_effect_of_the_others():
    recordings = {"a": np.array([0, 1]), "b": np.array([2]), "fast": np.array([3]), "still": np.array([4])}
    before, after = residuals([5, 5, 5, 100, 1]), residuals([2, 2, 3, 100, 1])
    two = marked({}, recordings).explained(before, after)  # half of them: 21/24, 16/24 and 0; "still" shows nothing
    assert two == pytest.approx(16 / 24)
    del recordings["b"]  # of two that show anything no median is taken
    before, after = before[[0, 1, 3, 4]], after[[0, 1, 3, 4]]
    recordings["fast"], recordings["still"] = np.array([2]), np.array([3])
    assert marked({}, recordings).explained(before, after) < 0.9 * 21 / 24
    # one effect that shows in a single motion explains what it explains of all
    assert marked({}, {k: np.array([i]) for i, k in enumerate("abc")}).explained(
        residuals([50, 2, 2]), residuals([1, 2, 2])
    ) == pytest.approx(explained_share(200 ** (1 / 3), 4 ** (1 / 3)))


def test_errors_are_told_of_what_is_marked_and_evidence_is_from_all():
    recordings = {name: np.array([i]) for i, name in enumerate("abcd")}
    study, left = marked({"b": "check"}, recordings), residuals([9, 3, 9, 9])
    assert study.error(left) == pytest.approx(3.0)
    assert marked({}, recordings).error(left) == pytest.approx((9**3 * 3) ** (1 / 4))
    grasps = study.target.grasps
    assert [fold.tolist() for fold in evidence_folds(grasps)] == [[1], [0], [2], [3]]
    assert [fold.tolist() for fold in make_folds(grasps)] == [[1]]
    of_one = marked({"b": "check", "c": "check", "d": "check"}, recordings).target.grasps
    assert [fold.tolist() for fold in evidence_folds(of_one)] == [[1, 2, 3]]  # one recording is left to fit


def test_recordings_decide_between_effects_and_none_may_be_harmed(made_up):
    good = made_up.diagnosis("effect").steps[0].candidates[0]
    good = dataclasses.replace(good, p_family=0.002, share=0.9, largest_fall=0.5)
    one, other = np.array([1.0, 0.0]), np.array([0.0, 1.0])
    many = np.ones(40)  # windows that all agree, of three recordings that do not
    winner = dataclasses.replace(good, gains=10 * many, of_recordings=np.array([405.0, -2, -3]), signature=one)
    rival = dataclasses.replace(good, gains=9 * many, of_recordings=np.array([0.0, 180, 180]), signature=other)
    assert indistinguishable(winner, rival)
    assert not indistinguishable(*(dataclasses.replace(c, of_recordings=None) for c in (winner, rival)))
    assert is_significant(winner, 0.02)  # it shows in one motion alone, and does no harm
    assert not is_significant(dataclasses.replace(winner, harms=True), 0.02)
    assert is_significant(dataclasses.replace(winner, harms=True, of_recordings=np.array([200.0, 150, 50])), 0.02)
