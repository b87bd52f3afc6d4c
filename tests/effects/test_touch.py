"""Depths of pads in an object: from where it was first felt, until the row is reset."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from forcegrasp.effects import Effect
from forcegrasp.effects.touch import depth_in_object, untouched


class Feeler(Effect):
    """Remembers surfaces and nothing else."""

    name, stage, parameters = "feeler", "contact", ()

    def init(self, which: np.ndarray) -> dict[str, np.ndarray]:
        return {"surface": untouched(which)}


@pytest.fixture
def feeler() -> Feeler:
    return Feeler(np.empty((2, 0)), 0.002)


def _depth(feeler: Feeler, position: float, force: float, thing: float = 0.0) -> np.ndarray:
    """Of both fingers at one position, in both rows, metres, ``(2, 2)``."""
    both = np.full((2, 2), position)
    plant = SimpleNamespace(pad_position=both, pad_shift_m=np.zeros((2, 2)), object_position=np.full(2, thing))
    return depth_in_object(feeler.attach(plant, np.arange(2)), np.full((2, 2), force))


def test_depth_counts_from_the_first_touch(feeler):
    assert (_depth(feeler, 0.030, 0.0) == -np.inf).all()
    np.testing.assert_array_equal(_depth(feeler, 0.025, 0.1), 0.0)
    np.testing.assert_allclose(_depth(feeler, 0.024, 0.5), 0.001)
    np.testing.assert_allclose(_depth(feeler, 0.026, 0.0), -0.001)  # let go, but not forgotten


def test_an_object_that_moves_right_is_deeper_on_the_right(feeler):
    _depth(feeler, 0.025, 0.1)
    np.testing.assert_allclose(_depth(feeler, 0.025, 0.1, thing=0.002), [[-0.002, 0.002]] * 2)


def test_a_reset_forgets_the_surface_of_its_rows_alone(feeler):
    _depth(feeler, 0.025, 0.1)
    feeler.reset(np.array([1]))
    np.testing.assert_allclose(_depth(feeler, 0.020, 0.1), [[0.005, 0.005], [0.0, 0.0]], atol=1e-15)
