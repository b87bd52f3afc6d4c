"""Depths of pads in an object: from where it was first felt, until the row is reset."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from forcegrasp.effects.touch import Touch

ROWS = np.arange(2)


def _depth(touch: Touch, position: float, force: float, thing: float = 0.0) -> np.ndarray:
    """Of both fingers at one position, in both rows, metres, ``(2, 2)``."""
    both = np.full((2, 2), position)
    plant = SimpleNamespace(pad_position=both, pad_shift_m=np.zeros((2, 2)), object_position=np.full(2, thing))
    return touch.depth(plant, ROWS, np.full((2, 2), force))


def test_depth_counts_from_the_first_touch():
    touch = Touch(2)
    assert (_depth(touch, 0.030, 0.0) == -np.inf).all()
    np.testing.assert_array_equal(_depth(touch, 0.025, 0.1), 0.0)
    np.testing.assert_allclose(_depth(touch, 0.024, 0.5), 0.001)
    np.testing.assert_allclose(_depth(touch, 0.026, 0.0), -0.001)  # let go, but not forgotten


def test_an_object_that_moves_right_is_deeper_on_the_right():
    touch = Touch(2)
    _depth(touch, 0.025, 0.1)
    np.testing.assert_allclose(_depth(touch, 0.025, 0.1, thing=0.002), [[-0.002, 0.002]] * 2)


def test_a_reset_forgets_the_surface_of_its_rows_alone():
    touch = Touch(2)
    _depth(touch, 0.025, 0.1)
    touch.reset(np.array([1]))
    np.testing.assert_allclose(_depth(touch, 0.020, 0.1), [[0.005, 0.005], [0.0, 0.0]], atol=1e-15)
