"""A fit ends where its steps make no difference, and not where only its slopes were wrong."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from forcegrasp.identify import fit
from forcegrasp.identify.priors import Priors
from forcegrasp.identify.simulators import STEP

TRUE = np.array([0.3, -0.2])


class Box:
    """Two coordinates between bounds."""

    low, high, priors = np.full(2, -1.0), np.full(2, 1.0), Priors.none(2)

    def __len__(self) -> int:
        return 2


class Line:
    """A straight line of 400 readings, predicted by a model that is rough at every scale, as contacts are.

    Args:
      roughness: of the predictions, in units of the noise.
      stale: whether slopes know of the first coordinate alone until they are measured anew.
    """

    def __init__(self, roughness: float = 0.0, stale: bool = False) -> None:
        time = np.linspace(-1, 1, 400)
        self.slope = 100 * np.stack([np.ones(400), time + 0.5], axis=1)
        readings = self.slope @ TRUE + np.random.default_rng(0).standard_normal(400)
        self.target = SimpleNamespace(
            weight=np.ones((1, 1, 1)), residual=lambda s: readings.reshape(1, 400, 1) - s, readings=400
        )
        self.problem, self._roughness, self._stale, self.measured_at = Box(), roughness, stale, None

    def value(self, x: np.ndarray) -> np.ndarray:
        rough = self._roughness * np.sin(1e7 * x.sum() + np.arange(400))
        return (self.slope @ x + rough).reshape(1, 400, 1)

    def slopes(self, x: np.ndarray, anew: bool = False) -> np.ndarray:
        if anew:
            self._stale, self.measured_at = False, x.copy()
        return (self.slope * [1.0, not self._stale]).reshape(1, 400, 1, 2)

    def has_measured(self, x: np.ndarray) -> bool:
        return self.measured_at is not None and np.array_equal(self.measured_at, x)

    def recall(self, x: np.ndarray, signals: np.ndarray) -> None:
        """Nothing is remembered."""


def descended(line: Line, start: np.ndarray, rough: bool = False) -> tuple[np.ndarray, int]:
    return fit._descend(cast(Any, line), start, 0.0, np.ones(2, bool), rough)


@pytest.mark.parametrize("roughness", [0.02, 0.1, 0.5])
@pytest.mark.parametrize("rough", [False, True])
def test_it_does_not_go_on_with_ever_smaller_steps(roughness, rough, monkeypatch):
    vector, count = descended(Line(roughness), np.full(2, 0.5), rough)
    np.testing.assert_allclose(vector, TRUE, atol=0.005)
    assert descended(Line(roughness), vector, rough)[1] == 2  # where it is, and one step that leads nowhere
    monkeypatch.setattr(fit, "_SMALLEST_STEP", 0.0)
    monkeypatch.setattr(fit, "_FLAT", -1.0)
    assert descended(Line(roughness), np.full(2, 0.5), rough)[1] > count


@pytest.mark.parametrize(("rough", "fewer"), [(False, 2), (True, 0)])
def test_two_steps_that_fail_one_after_the_other_end_it(rough, fewer, monkeypatch):
    monkeypatch.setattr(fit, "_SMALLEST_STEP", 0.0)
    monkeypatch.setattr(fit, "_FLAT", -1.0)
    vector, count = descended(Line(0.1), np.full(2, 0.5), rough)
    np.testing.assert_allclose(vector, TRUE, atol=0.005)
    monkeypatch.setattr(fit, "_FAILED", 99)
    assert descended(Line(0.1), np.full(2, 0.5), rough)[1] == count + fewer  # rough ones are left to go on


@pytest.mark.parametrize("roughness", [0.0, 0.05])
def test_slopes_measured_where_it_ended_lead_on(roughness):
    start = np.array([0.3, -0.185])  # so near that it is within twice the noise
    (vector, _), (roughly, _) = (descended(Line(roughness, stale=True), start, rough) for rough in (False, True))
    np.testing.assert_allclose(vector, TRUE, atol=0.003)
    assert abs(roughly - TRUE).max() > 0.005  # of rough fits that is not asked


def test_far_from_the_noise_they_need_not():
    """There the model is wrong by more than slopes can promise."""
    vector, _ = descended(Line(stale=True), np.array([0.3, 0.5]))
    assert abs(vector - TRUE).max() > STEP
