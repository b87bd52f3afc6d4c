"""What counts as evidence apart: grasps, or a servo's recordings."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from forcegrasp.diagnosis.study import Study


def study(recordings: dict[str, np.ndarray], weight: np.ndarray) -> Study:
    return Study(SimpleNamespace(recordings=recordings, weight=weight), None, ())  # pyright: ignore[reportArgumentType]


def residuals(sizes: list[float]) -> np.ndarray:
    """Of windows with two readings each, ``(G, 2, 1)``."""
    return np.array(sizes)[:, None, None] * np.ones((len(sizes), 2, 1))


def test_recordings_are_evidence_apart_and_windows_are_not():
    three = {"a": np.array([0, 1]), "b": np.array([2]), "c": np.array([3])}
    weight = np.array([1.0, 1.0, 0.5, 1.0])[:, None, None]
    before, after = residuals([3, 2, 4, 1]), residuals([1, 2, 2, 1])
    assert study(three, weight).gains(before, after) == pytest.approx([9 - 1, (16 - 4) / 4, 0])
    two = {"a": np.array([0, 1]), "b": np.array([2, 3])}  # too few to scatter
    assert study(two, weight).gains(before, after) == pytest.approx([8, 0, 3, 0])


def test_what_is_not_held_out_is_no_evidence():
    before, after = residuals([3, np.nan, 2, 1]), residuals([1, np.nan, 1, 1])
    ones = np.ones((4, 1, 1))
    np.testing.assert_allclose(study({}, ones).gains(before, after), [8, np.nan, 3, 0])
    four = {name: np.array([k]) for k, name in enumerate("abcd")}
    assert study(four, ones).gains(before, after) == pytest.approx([8, 3, 0])
